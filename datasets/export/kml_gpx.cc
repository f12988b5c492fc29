#include <fmt/format.h>

#include "datasets/export/layer_files.h"
#include "datasets/export/layer_text.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

// KML's colours are aabbggrr.
std::string KmlColour(const std::string& rgb, const char* alpha) {
  return alpha + rgb.substr(5, 2) + rgb.substr(3, 2) + rgb.substr(1, 2);
}

std::string KmlCoordinates(const LayerFeature& feature, LayerGeometry kind, const HeightSystem& heights) {
  std::string text;
  const auto add = [&](const Geodetic& g) {
    text += fmt::format("{:.9f},{:.9f},{:.4f} ", g.longitude_deg, g.latitude_deg,
                        heights.ellipsoidal() ? 0 : heights.FromEllipsoidal(g));
  };
  for (const Geodetic& g : feature.geometry) add(g);
  if (kind == LayerGeometry::kPolygon) add(feature.geometry.front());
  text.pop_back();
  return text;
}

std::string KmlGeometry(const LayerFeature& feature, LayerGeometry kind, const HeightSystem& heights) {
  const std::string mode = heights.ellipsoidal() ? "clampToGround" : "absolute";
  const std::string body = "<altitudeMode>" + mode + "</altitudeMode>";
  const std::string coordinates = "<coordinates>" + KmlCoordinates(feature, kind, heights) + "</coordinates>";
  switch (kind) {
    case LayerGeometry::kPoint: return "<Point>" + body + coordinates + "</Point>";
    case LayerGeometry::kLine: return "<LineString><tessellate>1</tessellate>" + body + coordinates + "</LineString>";
    case LayerGeometry::kPolygon:
      return "<Polygon><tessellate>1</tessellate>" + body + "<outerBoundaryIs><LinearRing>" + coordinates +
             "</LinearRing></outerBoundaryIs></Polygon>";
  }
  return "";
}

void RequireWgs84(const LayerFrame& frame, const char* format) {
  if (frame.crs.epsg() == 4326) return;
  throw OptionError(fmt::format("{} is WGS 84 by its definition, not EPSG:{}; use --to gpkg or csv for another system",
                                format, frame.crs.epsg()));
}

}  // namespace

void WriteKml(const std::filesystem::path& file, const std::vector<Layer>& layers, const LayerFrame& frame) {
  RequireWgs84(frame, "KML");
  std::string text =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<kml xmlns=\"http://www.opengis.net/kml/2.2\">\n<Document>\n";
  text += "<name>" + XmlText(frame.about) + "</name>\n";
  for (const Layer& layer : layers) {
    text += fmt::format(
        "<Style "
        "id=\"{}\"><IconStyle><color>{}</color><scale>0.7</scale><Icon><href>http://maps.google.com/mapfiles/kml/"
        "shapes/placemark_circle.png</href></Icon></IconStyle><LineStyle><color>{}</color><width>2</width></LineStyle>"
        "<PolyStyle><color>{}</color></PolyStyle></Style>\n",
        layer.name, KmlColour(layer.colour, "ff"), KmlColour(layer.colour, "ff"), KmlColour(layer.colour, "50"));
  }
  for (const Layer& layer : layers) {
    text += "<Folder><name>" + XmlText(layer.name) + "</name><description>" + XmlText(layer.title) + "</description>\n";
    for (const LayerFeature& feature : layer.features) {
      if (feature.geometry.empty()) continue;
      text +=
          "<Placemark><name>" + XmlText(feature.name) + "</name><styleUrl>#" + layer.name + "</styleUrl><ExtendedData>";
      for (size_t i = 0; i < layer.fields.size(); ++i) {
        const std::string value = ValueText(feature.values[i], layer.fields[i]);
        if (value.empty()) continue;
        text += "<Data name=\"" + layer.fields[i].name + "\"><value>" + XmlText(value) + "</value></Data>";
      }
      text += "</ExtendedData>" + KmlGeometry(feature, layer.geometry, frame.heights) + "</Placemark>\n";
    }
    text += "</Folder>\n";
  }
  WriteFileAtomically(file, text + "</Document>\n</kml>\n");
}

void WriteGpx(const std::filesystem::path& file, const std::vector<Layer>& layers, const LayerFrame& frame) {
  RequireWgs84(frame, "GPX");
  std::string waypoints, tracks;
  const auto place = [&](const Geodetic& g) {
    return fmt::format("lat=\"{:.9f}\" lon=\"{:.9f}\"><ele>{:.4f}</ele>", g.latitude_deg, g.longitude_deg,
                       frame.heights.FromEllipsoidal(g));
  };
  for (const Layer& layer : layers) {
    for (const LayerFeature& feature : layer.features) {
      if (feature.geometry.empty() || layer.geometry == LayerGeometry::kPolygon) continue;
      // The schema fixes the order: ele, time, geoidheight, name, type.
      const auto point = [&](const char* tag, size_t i, const std::string& rest) {
        std::string text = std::string("<") + tag + " " + place(feature.geometry[i]);
        if (i < feature.times_ns.size()) text += "<time>" + UtcText(feature.times_ns[i]) + "</time>";
        text += fmt::format("<geoidheight>{:.4f}</geoidheight>", frame.heights.Undulation(feature.geometry[i]));
        return text + rest + "</" + tag + ">\n";
      };
      if (layer.geometry == LayerGeometry::kPoint) {
        waypoints += point("wpt", 0, "<name>" + XmlText(feature.name) + "</name><type>" + layer.name + "</type>");
        continue;
      }
      tracks += "<trk><name>" + XmlText(feature.name) + "</name><type>" + layer.name + "</type><trkseg>\n";
      for (size_t i = 0; i < feature.geometry.size(); ++i) tracks += point("trkpt", i, "");
      tracks += "</trkseg></trk>\n";
    }
  }
  WriteFileAtomically(file,
                      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<gpx version=\"1.1\" creator=\"trigpoint\" "
                      "xmlns=\"http://www.topografix.com/GPX/1/1\">\n<metadata><desc>" +
                          XmlText(frame.about) + "</desc></metadata>\n" + waypoints + tracks + "</gpx>\n");
}

std::vector<std::filesystem::path> WriteLayerTables(const std::filesystem::path& dir, const std::vector<Layer>& layers,
                                                    const LayerFrame& frame) {
  std::vector<std::filesystem::path> files;
  for (const Layer& layer : layers) {
    std::vector<std::string> columns = {"name", frame.crs.geographic() ? "longitude_out_deg" : "easting_out",
                                        frame.crs.geographic() ? "latitude_out_deg" : "northing_out",
                                        frame.heights.ellipsoidal() ? "height_out_m" : "height_out_msl_m"};
    if (layer.geometry != LayerGeometry::kPoint) columns.insert(columns.begin() + 1, "vertex");
    for (const LayerField& field : layer.fields) columns.push_back(field.name);
    CsvWriter csv(columns, {fmt::format("trigpoint {} export 1; crs=EPSG:{} ({}); heights={}; {}", layer.name,
                                        frame.crs.epsg(), frame.crs.name(), frame.heights.name(), frame.about)});
    for (const LayerFeature& feature : layer.features) {
      for (size_t v = 0; v < std::max<size_t>(1, feature.geometry.size()); ++v) {
        csv.Text(feature.name);
        if (layer.geometry != LayerGeometry::kPoint) csv.Integer(static_cast<int64_t>(v));
        if (v < feature.geometry.size()) {
          const Eigen::Vector2d xy = frame.crs.FromGeodetic(feature.geometry[v]);
          const int decimals = frame.crs.geographic() ? 9 : 4;
          csv.Number(xy.x(), decimals).Number(xy.y(), decimals);
          csv.Number(frame.heights.FromEllipsoidal(feature.geometry[v]), 4);
        } else {
          csv.Empty(3);
        }
        for (size_t i = 0; i < layer.fields.size(); ++i) csv.Text(ValueText(feature.values[i], layer.fields[i]));
        csv.EndRow();
      }
    }
    files.push_back(dir / (layer.name + ".csv"));
    csv.Save(files.back());
  }
  return files;
}

}  // namespace trigpoint
