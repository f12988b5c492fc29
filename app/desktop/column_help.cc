#include "app/desktop/column_help.h"

#include <QRegularExpression>
#include <map>
#include <utility>

namespace trigpoint {

namespace {

// "errors:status": of one table; "check/tags:runs": of one stage's. Without a table: wherever the name occurs.
constexpr std::pair<const char*, const char*> kMeanings[] = {
    // What a row is about.
    {"run", "run of images"},
    {"variant", "variant of the options; empty: the first results"},
    {"station", "station at which the panorama was taken"},
    {"panorama", "panorama, photo or photo set"},
    {"photo", "photo of the set"},
    {"view", "rectilinear view of the panorama, or photo of a set"},
    {"image", "image of the run"},
    {"camera", "camera of the run, as camchain.yaml names it"},
    {"timestamp", "time of the image on the run's own clock, seconds"},
    {"tag_id", "number of the tag"},
    {"family", "family of the tag"},
    {"point", "surveyed point"},
    {"role", "control: may hold the map; check: is only compared"},
    {"status", "state of the row, in one word"},
    {"reason", "why there is no value"},
    {"system", "program whose poses are compared"},
    {"images", "images that show it or belong to it"},
    {"runs", "runs that show or localized it"},
    {"tags", "tags that are seen"},
    {"rank", "the best comes first"},
    {"what", "what is proposed or compared"},
    // Positions and rotations.
    {"x", "position, x"},
    {"y", "position, y"},
    {"z", "position, z"},
    {"tx", "position in the rig: right of its origin"},
    {"ty", "position in the rig: below its origin"},
    {"tz", "position in the rig: in front of its origin"},
    {"odom_x", "position in the run's own frame (odom), x"},
    {"odom_y", "position in the run's own frame (odom), y"},
    {"odom_z", "position in the run's own frame (odom), z"},
    {"latitude_deg", "latitude on WGS 84"},
    {"longitude_deg", "longitude on WGS 84"},
    {"height_m", "height above the WGS 84 ellipsoid"},
    {"easting_m", "easting in the project's coordinate system"},
    {"northing_m", "northing in the project's coordinate system"},
    {"heading_deg", "direction of the optical axis or of a panorama's image centre, clockwise from true north"},
    {"pitch_deg", "angle of the optical axis above the horizon"},
    {"roll_deg", "roll, clockwise as seen from behind the camera"},
    {"sigma_heading_deg", "1 sigma of the heading"},
    {"sigma_pitch_deg", "1 sigma of the pitch"},
    {"sigma_roll_deg", "1 sigma of the roll"},
    {"sigma_e_m", "1 sigma to the east"},
    {"sigma_n_m", "1 sigma to the north"},
    {"sigma_u_m", "1 sigma upwards"},
    {"sigma_rx_deg", "1 sigma of the rotation about the axis x of the frame"},
    {"tags:sigma_rx_deg", "1 sigma of the rotation about the tag's own axis x"},
    {"sigma_ry_deg", "1 sigma of the rotation about the axis y of the frame"},
    {"tags:sigma_ry_deg", "1 sigma of the rotation about the tag's own axis y"},
    {"sigma_rz_deg", "1 sigma of the rotation about the axis z of the frame"},
    {"tags:sigma_rz_deg", "1 sigma of the rotation about the tag's own axis z"},
    // Errors.
    {"method", "panorama (G2): one answer for the whole panorama; view (G1): one for each rectilinear view"},
    {"reference",
     "ground truth that the answer is compared with: self (the run's own tags), control (surveyed "
     "points), survey (the tag map), or a release"},
    {"kind", "relative: in the run's own frame; absolute: in the site's frame"},
    {"errors:status", "localized, rejected or unmatched; no_reference, missing: there is nothing to compare"},
    {"error_3d_m", "distance in space between the answer and the reference"},
    {"error_h_m", "horizontal distance between the answer and the reference"},
    {"error_v_m", "difference in height between the answer and the reference, without sign"},
    {"de_m", "difference to the east: answer minus reference"},
    {"dn_m", "difference to the north: answer minus reference"},
    {"du_m", "difference upwards: answer minus reference"},
    {"error_rot_deg", "angle between the rotations of the answer and the reference"},
    {"errors:sigma_e_m", "1 sigma of the difference to the east, the ground truth's included"},
    {"errors:sigma_n_m", "1 sigma of the difference to the north, the ground truth's included"},
    {"errors:sigma_u_m", "1 sigma of the difference upwards, the ground truth's included"},
    {"sigma_rot_deg", "1 sigma of the rotation, root mean square of the axes"},
    {"nees", "squared error over its stated covariance; about dof if the sigmas are right"},
    {"nees_h", "squared horizontal error over its covariance; about 2 if the sigmas are right"},
    {"nees_v", "squared vertical error over its variance; about 1 if the sigmas are right"},
    {"dof", "degrees of freedom of nees"},
    {"sigma_tag_map_m", "part of the 1 sigma in space that comes from the tag map"},
    {"sigma_offset_m", "part of the 1 sigma in space that comes from the offset between station and tag"},
    {"sigma_stitch_m", "part of the 1 sigma in space that comes from stitching"},
    {"sigma_localization_m", "part of the 1 sigma in space that comes from localization"},
    {"dominant", "the largest part of the 1 sigma"},
    {"parallax_deg", "parallax of the points around the panorama (within 30 m), median"},
    {"structure_m", "distance of the points around the panorama (within 30 m), median"},
    {"depth_sigma_m", "distance over parallax times 1 mrad, median of the points around the panorama"},
    {"trusted", "whether depth_sigma_m keeps the limit trust_depth_sigma_m"},
    {"shares_evidence", "1: answer and reference depend on the same data: agreement, not accuracy"},
    {"error_m", "error in space"},
    {"share", "share of the attempts with at most this error"},
    {"low", "lower limit of the share's confidence band"},
    {"high", "upper limit of the share's confidence band"},
    {"coverage", "share of the answers that are used, the best supported depth first"},
    {"median_m", "median of the errors in space"},
    {"p90_m", "90th percentile of the errors in space"},
    {"max_m", "largest error in space"},
    {"reference_status", "how the reference pose is determined: tags, bridged or none"},
    {"estimates:sigma_e_m", "1 sigma of the estimate to the east, as it states it"},
    {"estimates:sigma_n_m", "1 sigma of the estimate to the north, as it states it"},
    {"estimates:sigma_u_m", "1 sigma of the estimate upwards, as it states it"},
    {"estimates:de_m", "difference to the east: estimate minus reference"},
    {"estimates:dn_m", "difference to the north: estimate minus reference"},
    {"estimates:du_m", "difference upwards: estimate minus reference"},
    {"reference_sigma_e_m", "1 sigma of the reference to the east"},
    {"reference_sigma_n_m", "1 sigma of the reference to the north"},
    {"reference_sigma_u_m", "1 sigma of the reference upwards"},
    {"bridged_m", "path since the last image with a tag, over which the run's motion leads"},
    // Answers of localize.
    {"panoramas:status", "localized, rejected or unmatched"},
    {"view_matches", "matches between the panorama and the run's images"},
    {"inliers", "matches that agree with the answer"},
    {"views", "views of the panorama that have such matches"},
    {"geotag_de_m", "difference to the east: geotag minus answer"},
    {"geotag_dn_m", "difference to the north: geotag minus answer"},
    {"geotag_du_m", "difference upwards: geotag minus answer"},
    {"geotag_status", "whether the geotag was used for the run's position, or contradicts it"},
    {"odom_sigma_x_m", "1 sigma of the position in the run's own frame (odom), x"},
    {"odom_sigma_y_m", "1 sigma of the position in the run's own frame (odom), y"},
    {"odom_sigma_z_m", "1 sigma of the position in the run's own frame (odom), z"},
    {"matched_share", "found points as a share of those that should be seen"},
    {"distance_m", "distance of the answer from the nearest camera of the run"},
    {"u_image", "pixel in the image, to the right"},
    {"v_image", "pixel in the image, down"},
    {"u_view", "pixel in the view, to the right"},
    {"v_view", "pixel in the view, down"},
    {"freedom", "what of the photo's pose was refined with the run's points"},
    // Tags and the survey.
    {"hamming", "bits of the tag's code that had to be corrected"},
    {"margin", "decision margin: how clearly the bits of the code are black or white"},
    {"sigma_px", "1 sigma of a coordinate in the picture"},
    {"size_m", "edge of the tag's black square"},
    {"rms_px", "root mean square of the residuals in the pictures"},
    {"tags:status",
     "ok; weak: too few pictures; ambiguous: two solutions; duplicate: at two places; moved; size: "
     "the printed size is contradicted; bent; unsolved"},
    {"control:status", "used, taken out (contradicts the other control), or not used"},
    {"check:status", "check, or moved: the tag has moved"},
    {"stated_x", "position as surveyed, x"},
    {"stated_y", "position as surveyed, y"},
    {"stated_z", "position as surveyed, z"},
    {"stated_sigma_h_m", "horizontal 1 sigma of the survey, per axis"},
    {"stated_sigma_v_m", "vertical 1 sigma of the survey"},
    {"covariance_en_m2", "covariance of the differences to the east and to the north"},
    {"standardised", "size of the residual or difference in its own sigmas"},
    {"standardised_e", "difference to the east in its own sigmas"},
    {"standardised_n", "difference to the north in its own sigmas"},
    {"standardised_u", "difference upwards in its own sigmas"},
    {"left_out_de_m", "difference to the east if the map were made without the point"},
    {"left_out_dn_m", "difference to the north if the map were made without the point"},
    {"left_out_du_m", "difference upwards if the map were made without the point"},
    {"left_out_sigma_e_m", "1 sigma of left_out_de_m"},
    {"left_out_sigma_n_m", "1 sigma of left_out_dn_m"},
    {"left_out_sigma_u_m", "1 sigma of left_out_du_m"},
    {"chi2_3dof", "squared difference over its covariance, of 3 degrees of freedom"},
    {"chi2_6dof", "squared difference of the poses over its covariance, of 6 degrees of freedom"},
    {"chi2_8dof", "squared residuals of the tag's 8 coordinates over their variances"},
    {"setup", "set-up of the total station"},
    {"target", "target of the reading"},
    {"reading", "direction, zenith angle or slope distance"},
    {"observed", "value that was read"},
    {"stated_sigma", "1 sigma of the reading as stated"},
    {"residual", "value by the map minus value read"},
    {"unit", "unit of the row's values"},
    {"line", "line of total_station.csv"},
    {"from", "first tag"},
    {"to", "second tag"},
    {"measured_m", "distance as measured"},
    {"stated_sigma_m", "1 sigma of the measured distance as stated"},
    {"map_m", "the distance by the map"},
    {"difference_m", "distance by the map minus measured distance"},
    {"distances:sigma_m", "1 sigma of the difference"},
    {"sessions:kind", "run or photo set"},
    {"session", "date of the run"},
    {"observations", "tags in images"},
    {"rejected", "observations that were left out"},
    {"corner_factor", "factor on the stated sigmas of corners"},
    {"scale", "true length over the length by the odometry"},
    {"scale_sigma", "1 sigma of the scale"},
    {"heading_drift_deg_m", "turn of the odometry's heading for each metre"},
    {"heading_drift_sigma_deg_m", "1 sigma of the heading's drift"},
    {"odometry_jumps", "jumps that were found in the odometry"},
    {"repeatability_m", "root mean square of the tags: the map without this run against the map of all"},
    {"repeatability_tags", "tags that were compared for it"},
    {"sigma_3d_m", "1 sigma of the tag's centre in space, three axes in quadrature"},
    {"control_m", "part of sigma_3d_m that comes from control points"},
    {"geotags_m", "part of sigma_3d_m that comes from geotags"},
    {"gps_m", "part of sigma_3d_m that comes from GPS"},
    {"corners_m", "part of sigma_3d_m that comes from corners of tags and marks"},
    {"odometry_m", "part of sigma_3d_m that comes from odometry"},
    {"scene_points_m", "part of sigma_3d_m that comes from points of the scene"},
    {"distances_m", "part of sigma_3d_m that comes from measured distances and total stations"},
    {"other_m", "part of sigma_3d_m that comes from other assumptions"},
    {"limited_by", "the largest part of sigma_3d_m"},
    {"earlier_epoch", "epoch of the earlier coordinates"},
    {"used_epoch", "epoch of the coordinates that are used"},
    {"control_epochs:status", "moved (beyond 99.9 %) or same"},
    {"control_epochs:de_m", "difference to the east: epoch used minus earlier epoch"},
    {"control_epochs:dn_m", "difference to the north: epoch used minus earlier epoch"},
    {"control_epochs:du_m", "difference upwards: epoch used minus earlier epoch"},
    {"changes:de_m", "difference to the east: now minus before"},
    {"changes:dn_m", "difference to the north: now minus before"},
    {"changes:du_m", "difference upwards: now minus before"},
    {"turned_deg", "angle between the rotations now and before"},
    {"stations:status", "agrees, contradicts (beyond 99.9 %) or unseen"},
    {"stations:chi2", "squared difference of stated and estimated offset over its covariance, 3 degrees of freedom"},
    {"right_m", "estimated offset from the tag along the wall, to the right"},
    {"out_m", "estimated offset from the tag out of the wall"},
    {"up_m", "estimated offset from the tag upwards"},
    {"sigma_right_m", "1 sigma of right_m"},
    {"sigma_out_m", "1 sigma of out_m"},
    {"own_tag", "1: the station's own tag is among the tags used"},
    // Plans, checks and stitching.
    {"pass", "planned pass along a path"},
    {"passes", "passes that see the tag"},
    {"images_needed", "pictures that reach the wanted sigma; empty: no number does"},
    {"ellipse_a_m", "1 sigma along the long axis of the horizontal ellipse"},
    {"ellipse_b_m", "1 sigma along the short axis of the horizontal ellipse"},
    {"ellipse_bearing_deg", "bearing of the ellipse's long axis, clockwise from north"},
    {"points", "points of the scene that are seen"},
    {"matches", "matches that agree, or that are to be expected"},
    {"candidates", "matches before those that disagree were left out"},
    {"side_px", "edge of the tag in the picture"},
    {"angle_deg", "angle between the tag's normal and the line of sight"},
    {"redundancy", "0: nothing controls the observation; 1: the others determine it"},
    {"redundancy_h", "redundancy of the horizontal position"},
    {"redundancy_v", "redundancy of the height"},
    {"blunder_px", "smallest blunder that is found with 80 % probability"},
    {"blunder_m", "smallest blunder that is found with 80 % probability"},
    {"blunder_h_m", "smallest horizontal blunder that is found with 80 % probability"},
    {"blunder_v_m", "smallest vertical blunder that is found with 80 % probability"},
    {"effect_m", "how far an undetected blunder of that size moves the tag"},
    {"effect_h_m", "how far an undetected horizontal blunder moves the tag"},
    {"effect_v_m", "how far an undetected vertical blunder moves the tag"},
    {"used", "whether it takes part"},
    {"rms_before_m", "root mean square sigma of the tags in space, without the proposal"},
    {"rms_after_m", "root mean square sigma of the tags in space, with the proposal"},
    {"light", "green, amber or red"},
    {"topic", "what the finding is about"},
    {"finding", "what was found"},
    {"why", "why it is proposed"},
    {"from_x", "where to stand, x in the frame of the map"},
    {"from_y", "where to stand, y in the frame of the map"},
    {"from_z", "where to stand, z in the frame of the map"},
    {"next:heading_deg", "direction to look, clockwise from the map's y axis"},
    {"gains:heading_deg", "direction that the tag faces, clockwise from north"},
    {"pictures", "pictures that show the tag"},
    {"check/tags:runs", "runs that show the tag"},
    {"largest_px", "largest edge of the tag in a picture"},
    {"nearest_m", "smallest distance from which the tag was photographed"},
    {"left_deg", "direction farthest to the left from which it is seen, from the tag's normal"},
    {"right_deg", "direction farthest to the right from which it is seen, from the tag's normal"},
    {"photo_a", "first photo"},
    {"photo_b", "second photo"},
    {"focal_px", "focal length"},
    // Calibrations.
    {"u", "pixel, to the right"},
    {"v", "pixel, down"},
    {"du_px", "residual to the right: predicted minus observed"},
    {"dv_px", "residual down: predicted minus observed"},
    {"covered", "whether points of the board were seen there"},
    {"points_used", "points of the board that were used"},
    {"tilt_deg", "angle between the board and the picture"},
    {"calibrate/views:distance_m", "distance of the board"},
    {"calibrate/views:points", "points of the board that were found"},
    {"frame", "number of the exposure: pictures with the same one were taken together"},
    // Several runs together, cross-checks.
    {"shared_panoramas", "panoramas that other runs share"},
    {"shared_tags", "tags that other runs share"},
    {"shared_points", "points that other runs share"},
    {"odometry_scale", "true length over the length by the odometry"},
    {"odometry_scale_sigma", "1 sigma of the odometry's scale"},
    {"largest_move_m", "largest movement of a camera against the run by itself"},
    {"models", "models into which the reconstruction fell"},
    {"registered", "images that the other program placed"},
    {"reprojection_px", "mean reprojection error of the other program"},
    {"compared", "poses that both have"},
    {"rmse_m", "root mean square of the differences in space"},
    {"rotation_median_deg", "median angle between the rotations"},
    {"rotation_max_deg", "largest angle between the rotations"},
    {"normalised_median", "median difference over our stated covariance"},
    {"normalised_p95", "95th percentile of the differences over our stated covariance"},
    {"beyond_99", "share of the differences beyond the 99 % value of our covariance: 0.01 by chance"},
    {"step", "step of the other program"},
    {"wall_s", "time that it took"},
    {"cpu_s", "time of all processors"},
    {"peak_mib", "largest memory, MiB"},
    {"verdict", "how the two programs agree"},
    {"ours", "our status and reason"},
    {"alignment", "how the two were aligned"},
    {"name", "image or panorama"},
    {"dx_m", "theirs minus ours, x"},
    {"dy_m", "theirs minus ours, y"},
    {"dz_m", "theirs minus ours, z"},
    {"length_m", "length of the difference"},
    {"rotation_deg", "angle between the rotations"},
    {"normalised", "difference over our stated covariance: about 1 if they agree within it"},
};

// Names that many tables make of parts.
QString MadeOfParts(const QString& column) {
  static const std::pair<QRegularExpression, const char*> kParts[] = {
      {QRegularExpression("^(?:odom_|world_)?q([xyzw])$"), "rotation, part %1 of its unit quaternion"},
      {QRegularExpression("^sigma_t?([xyz])_m$"), "1 sigma of the position, %1"},
      {QRegularExpression("^c([0-5])([0-5])$"),
       "row %1, column %2 of the 6 x 6 covariance: rotation (rad) first, then translation (m)"},
      {QRegularExpression("^([uv])([0-3])$"), "pixel %1 of corner %2 (0 bottom-left, then counter-clockwise)"},
      {QRegularExpression("^(stated|estimated|combined)_(east|north|up)_m$"),
       "%1 offset of the station from its tag, %2"},
      {QRegularExpression("^(?:combined_)?sigma_(east|north|up)_m$"), "1 sigma of the offset, %1"},
      {QRegularExpression("^(?:image|panorama)_([ab])$"), "row and column of the covariance belong to this pose (%1)"},
  };
  for (const auto& [pattern, words] : kParts) {
    const QRegularExpressionMatch match = pattern.match(column);
    if (!match.hasMatch()) continue;
    QString text = words;
    for (int k = 1; k <= pattern.captureCount(); ++k) text.replace("%" + QString::number(k), match.captured(k));
    return text;
  }
  return "";
}

QString MeaningOf(const QString& title, const QString& column) {
  static const std::map<QString, const char*> kKnown(std::begin(kMeanings), std::end(kMeanings));
  const QString stage = title.section('/', 0, 0).section('@', 0, 0), file = title.section('/', -1);
  for (const QString& key : {stage + "/" + file + ":" + column, file + ":" + column, column}) {
    const auto found = kKnown.find(key);
    if (found != kKnown.end()) return found->second;
  }
  return MadeOfParts(column);
}

// Of a column that depends on it, by what the file's first line states: "trigpoint tags 1; frame=enu; ...".
QString FrameOf(const QString& comment, const QString& column) {
  static const QRegularExpression kDepends(
      "^(?!odom_)(?:(?:stated_)?[xyz]|q[xyzw]|(?:.*_)?(?:d|sigma_)[xyzenu]_m|sigma_r[xyz]_deg|c[0-5]{2})$");
  static const QRegularExpression kStated("(?:frame|axes)=([a-z]+)");
  if (!kDepends.match(column).hasMatch()) return "";
  const QString frame = kStated.match(comment).captured(1);
  if (frame == "enu") return "site: x east, y north, z up from its origin";
  if (frame == "local") return "the surveyor's own, not georeferenced";
  if (frame == "map") return "the tag map's own, without a datum";
  return frame == "odom" ? "the run's own (odom)" : QString();
}

}  // namespace

QString ColumnHelp(const DataTable& table, const QString& column, const QString& unit) {
  const QString meaning = MeaningOf(QString::fromStdString(table.title), column);
  if (meaning.isEmpty()) return column;
  const QString frame = FrameOf(QString::fromStdString(table.comment), column);
  QString help = meaning.left(1).toUpper() + meaning.mid(1);
  if (!unit.isEmpty()) help += " (" + unit + ")";
  if (!frame.isEmpty()) help += "\nFrame: " + frame;
  return help + "\nIn the file: " + column;
}

}  // namespace trigpoint
