// The page of a release that a person signs.
#include "eval/release/certificate.h"

#include <gmock/gmock.h>

#include <filesystem>

#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

// Of a map with one tag and so many check points.
class CertificateTest : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(dir_ / "map");
    WriteFileAtomically(dir_ / "control_points.csv",
                        "tag_id,latitude_deg,longitude_deg,height_m,sigma_h_m,sigma_v_m,role\n"
                        "7,48.0125810,7.8325131,241.1,0.008,0.012,control\n");
  }
  void TearDown() override { fs::remove_all(dir_); }

  std::string Page(int check_points, const std::string& author, const json& points = json::array()) {
    json survey = {{"datum", "control"}, {"points", points}};
    survey["check"] = {{"n", check_points},
                       {"rmse_h_m", 0.01},
                       {"rmse_v_m", 0.01},
                       {"rmse_3d_m", 0.014},
                       {"differences_rmse_h_m", 0.009},
                       {"differences_rmse_v_m", 0.009},
                       {"differences_rmse_3d_m", 0.013}};
    WriteFileAtomically(dir_ / "map" / "summary.json", survey.dump());
    WriteFileAtomically(dir_ / "map" / "tags.csv",
                        "tag_id,x,y,z,qx,qy,qz,qw,sigma_x_m,sigma_y_m,sigma_z_m,role,status\n"
                        "7,1,2,3,0,0,0,1,0.01,0.01,0.01,control,ok\n");
    const json record = {{"name", "may"},
                         {"project", "yard"},
                         {"published", "2026-05-12T09:43:20Z"},
                         {"user", "surveyor"},
                         {"program", json::object()},
                         {"stages", json::object()},
                         {"inputs", {{"tags.yaml", {{"copied", true}}}}}};
    ReleaseStatement statement;
    statement.author = author;
    WriteCertificate(Project::Open(dir_), record, statement, dir_);
    return ReadTextFile(dir_ / "certificate.html");
  }

  const fs::path dir_ = fs::path(testing::TempDir()) / "certificate_test";
};

TEST_F(CertificateTest, HasLinesToSignOn) {
  const std::string page = Page(4, "A. Surveyor");
  const std::string signature = page.substr(page.rfind("<h2"));
  EXPECT_THAT(signature, HasSubstr("Signature"));
  for (const char* label :
       {">Name<", ">Date<", ">Signature<", "To be signed by the person responsible (A. Surveyor)."}) {
    EXPECT_THAT(signature, HasSubstr(label));
  }
  EXPECT_THAT(Page(4, ""), HasSubstr("To be signed by the person responsible (not stated)."));
  EXPECT_GT(fs::file_size(dir_ / "certificate.pdf"), 1000U);
}

TEST_F(CertificateTest, CountsInTheSingular) {
  const std::string one = Page(1, "");
  EXPECT_THAT(one, HasSubstr("At 1 check point, which took no part"));
  EXPECT_THAT(one, HasSubstr("tested at 1 check point only"));
  EXPECT_THAT(one, HasSubstr("for 1 tag in space"));
  EXPECT_THAT(one, HasSubstr("1 file, 1 of them in the release"));
  EXPECT_THAT(one, Not(HasSubstr("1 check points")));
  EXPECT_THAT(Page(2, ""), HasSubstr("tested at 2 check points only"));
}

json CheckPoint(const std::string& name, double east_m, bool checked) {
  return {{"name", name},       {"role", "check"},   {"checked", checked}, {"map_minus_stated_m", {east_m, 0, 0}},
          {"sigma_h_m", 0.005}, {"sigma_v_m", 0.01}, {"chi2_3dof", 4.0}};
}

// The tag of a check point was moved: its difference is none of the map's, and no part of the RMSE above the table.
TEST_F(CertificateTest, MarksCheckPointsThatDoNotCount) {
  const std::string counted = Page(1, "", json::array({CheckPoint("57", 0.01, true)}));
  EXPECT_THAT(counted, HasSubstr("0.0100"));
  EXPECT_THAT(counted, HasSubstr(">check\n"));
  EXPECT_THAT(counted, Not(HasSubstr(">moved\n")));
  const std::string page = Page(1, "", json::array({CheckPoint("57", 0.01, true), CheckPoint("59", 0.8, false)}));
  EXPECT_THAT(page, HasSubstr("0.8000"));
  EXPECT_THAT(page, HasSubstr(">moved\n"));
}

}  // namespace
}  // namespace trigpoint
