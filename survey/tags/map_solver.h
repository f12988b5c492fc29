// The solution of a tag map: internal to survey/tags.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "calib/estimation/loss.h"
#include "calib/estimation/sparse_least_squares.h"
#include "survey/tags/map_start.h"

namespace trigpoint {

constexpr double kMoveChi2 = 35;       // 4e-6 at 6 degrees of freedom, since every tag of every run is asked
constexpr double kSlipChi2 = 30;       // 4e-5 at 6 degrees of freedom: odometry jumped
constexpr int kLeastSights = 3;        // of a tag that is said to have moved: in that run, and in the others
constexpr double kLeastMove_m = 0.02;  // less is no move but a weakness of the model
constexpr double kPointChi2 = 16.3;    // 99.9 %, 3 degrees of freedom
constexpr size_t kLeastVisit = 3;      // pictures that may place a tag by themselves

// Two sheets do not overlap.
inline bool IsAnotherPlace(double moved_m, double size_m) { return moved_m >= kLeastMove_m + 0.2 * size_m; }

class MapSolver {
 public:
  MapSolver(const SurveyInput& input, const SurveyOptions& options, int threads, ProgressSink& progress,
            const CancelToken& cancel);
  SurveyResult Run();

 private:
  // Adds a warning unless one with the same text is there.
  void Warn(const std::string& text);

  // What a factor observes; `index`: sight, frame, point, distance, reading of a total station.
  enum class Kind { kTag, kMark, kOdometry, kPoint, kFix, kDistance, kStation, kOther };
  struct Observation {
    Kind kind = Kind::kOther;
    int index = 0;
  };
  struct RunState {
    double scale = 1, drift = 0;                 // drift: rad/m
    double corner = 1;                           // factor on the corners' sigmas
    Vector6d odometry = Vector6d::Ones();        // and on odometry's
    std::vector<double> shift;                   // of each camera's corners, px
    int scale_unknown = -1, drift_unknown = -1;  // in the present solver
    std::vector<int> shift_unknown;
    std::vector<Camera> cameras;                       // as given
    std::vector<std::array<double, 5>> camera_change;  // survey_costs.h: AdjustedCamera
    std::vector<int> camera_unknown;
    std::vector<size_t> first_point;  // range of its tie points in the solver: begin, end
  };

  bool IsSeen(const SurveyPoint& p) const;
  void ChooseDatum();
  void DropDatumWithoutFrame();
  void RequireCredible() const;
  void LoadState();
  // map_gates.cc
  std::vector<Rigid3d> PlanarPlaces(const MapSight& s) const;
  void PlaceSplit();
  static bool IsTurned(const Rigid3d& in_map, const Rigid3d& in_run);
  std::set<int> ElsewhereIn(size_t run) const;
  void SplitElsewhere();
  std::vector<std::vector<MapSight*>> Visits();
  void GateStart();
  std::optional<double> ControlOff(const SurveyPoint& p) const;
  void GateControl();
  void ReturnControl();
  void FindLinked();
  bool Usable(const MapSight& s) const;
  bool Placed(int frame) const { return start_.frames[static_cast<size_t>(frame)].world_from_body.has_value(); }
  Eigen::Vector3d Lever(const SurveyPoint& p) const;
  bool Excluded(const SurveyPoint& p) const { return excluded_.count(p.name) > 0; }
  void Build();
  void AddRuns();
  void AddSights();
  void AddTies();
  void AddOdometry();
  void AddPoints();
  void AddFixes();
  void AddStations();
  int AddPlane(bool alone);
  void AddGauge();
  void Add(Kind kind, int index, ceres::CostFunction* cost, const ceres::LossFunction* loss,
           const std::vector<int>& unknowns);
  SparseLeastSquares::Summary Solve(bool linearise);
  void StoreState();
  void StoreCameras();
  void UpdateFactors();
  bool SnoopSights(int round);
  // map_slips.cc
  struct State;
  bool SnoopOdometry();
  double SlipChi2(int run) const;
  bool ReplaceSlips();
  double Score(double cost) const;
  std::map<std::pair<int, int>, std::set<int>> NearSlips() const;
  State Save() const;
  void Restore(const State& state);
  // map_hypotheses.cc
  struct Hypothesis;
  bool SnoopTags();
  void Test(Hypothesis* h, bool exact) const;
  std::vector<MapSight*> GivePlace(int tag_place, int run, const Rigid3d& world_from_tag);
  Eigen::MatrixXd DerivativeOf(const Hypothesis& h, int observation) const;
  void LeaveOutControlOn(int tag_id);
  void JudgePlaces(TagEstimate* tag) const;
  int IdOf(int place) const;
  double SizeOf(int place) const;
  std::optional<std::pair<int, double>> WorstControl(bool may_leave) const;
  bool SnoopControl();
  bool SnoopDistances();
  Rigid3d TagPose(int id) const { return solver_.Pose(tag_unknown_.at(id)); }
  bool ResidualOf(const MapSight& s, Vector8d* residual) const;
  double SightChi2(const MapSight& s) const;
  double SightPx(const MapSight& s) const;

  // map_result.cc
  void Collect();
  void CollectRuns();
  struct SeenTag;
  std::map<int, TagEstimate> JudgeByCameras();
  std::map<int, SeenTag> CountSights();
  void CollectTags();
  void CollectResiduals();
  void JudgeShape(TagEstimate* tag) const;
  void CompareWithPoints();
  void CompareDistances();
  void CompareStations();
  void ComparePlane();
  void CompareDatums();
  void DoubtDatum();
  std::vector<Hypothesis> TagHypotheses() const;  // these twelve: map_hypotheses.cc
  Hypothesis CommonSizeHypothesis() const;
  bool HasKnownLengths() const;
  std::optional<std::pair<double, double>> SizeByOdometry() const;
  bool OdometryAsksFor(double log_ratio) const;
  bool OdometryRulesOut(double log_ratio) const;
  void RequireMetres(const Hypothesis& all) const;
  bool ControlAsksFor(double chi2) const;
  bool SnoopCommonSize(const Hypothesis& all, double single);
  void AddSizeUncertainty(const Hypothesis& size, double sigma);
  void JudgeSizes();
  void JudgeCommonSize();
  void FitMapToPoints();
  // map_budget.cc
  BudgetSource SourceOf(const Observation& o) const;
  std::vector<std::array<double, kBudgetSources>> SharesOf(const std::vector<size_t>& tags,
                                                           const std::vector<int>& offsets,
                                                           Eigen::MatrixXd* cross) const;
  void CollectBudgets();
  void FindNextPoint(const Eigen::MatrixXd& cross, const std::vector<int>& offsets);
  void CrossCovariances();
  // Place of a point in the map, minus its offset's target, and its covariance there.
  std::string ControlNear(const SurveyPoint& p) const;
  bool PlaceOf(const SurveyPoint& p, Eigen::Vector3d* place, Eigen::Matrix3d* covariance) const;

  SurveyInput input_;  // cameras change where they are estimated
  const SurveyOptions& options_;
  int threads_;
  ProgressSink& progress_;
  const CancelToken& cancel_;
  SurveyResult result_;
  MapStart start_;
  std::vector<SurveyPoint> datum_points_;
  std::set<std::string> excluded_;         // control that contradicts the rest
  std::set<std::string> waiting_;          // of it: until the first solution
  std::vector<std::string> far_at_start_;  // control that the start has elsewhere
  std::set<int> wrong_distances_;          // the same of distances
  bool outvoted_ = false;                  // pictures were just rejected that the rest of their visit contradicts
  bool use_shift_ = false;                 // geotags have a datum of their own
  Eigen::Vector3d shift_ = Eigen::Vector3d::Zero();
  int shift_unknown_ = -1;
  std::vector<RunState> run_states_;
  std::map<int, Rigid3d> tags_;    // by place: a tag's id, or below zero an entry of moved_
  std::vector<SplitPlace> moved_;  // place -1 - k: where the tag stands in that run
  std::set<int> duplicates_;       // ids that stood at several places before anything was solved
  struct SizeFound {
    double log_ratio = 0, sigma = 0;  // to the stated size
  };
  std::map<int, SizeFound> sizes_found_;  // by place
  double common_log_size_ = 0;            // of all tags, to the stated sizes; 0: none was found
  std::map<std::string, Eigen::Vector3d> marked_;
  std::vector<Eigen::Vector3d> tie_points_;  // of all runs, kept between solutions
  std::unique_ptr<HuberChi2Loss> huber_;     // of the corners
  HuberChi2Loss odometry_loss_, geotag_loss_, mark_loss_, distance_loss_;
  std::vector<std::unique_ptr<HuberChi2Loss>> tie_losses_;
  SparseLeastSquares solver_;
  std::vector<Observation> observations_;  // one a factor
  std::vector<int> frame_unknown_;         // -1: not placed
  std::map<int, int> tag_unknown_;
  std::map<std::string, int> mark_unknown_;
  std::vector<std::pair<size_t, StationReading>> station_readings_;  // of a sighting
  std::set<int> unlinked_frames_, unlinked_tags_;                    // not tied to the largest part of the map
  std::set<int> slipped_;                                            // frames whose odometry from the one before jumped
  std::vector<MoveOrJump> undecided_;                                // what ReplaceSlips could not tell
};

}  // namespace trigpoint
