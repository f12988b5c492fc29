#include "eval/errors/evaluation_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/base/error.h"
#include "eval/errors/results.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

class EvaluationFiles : public ::testing::Test {
 protected:
  // Two runs at two stations; the second run has nothing to say about the second.
  static Evaluation Example() {
    const auto run = [](const std::string& name, double error1, std::optional<double> error2) {
      EvaluatedRun r{.run = name};
      for (int i = 0; i < 2; ++i) {
        TagResult tag;
        tag.tag_id = i;
        tag.map_from_tag = Rigid3d(Eigen::Quaterniond::Identity(), {10.0 * i, 0, 0});
        r.self_tags.push_back(tag);
        const std::optional<double> error = i == 0 ? std::optional(error1) : error2;
        PanoramaResult p{.panorama = "pano, " + std::to_string(i), .station = i == 0 ? "A" : "B"};
        p.status = error ? "localized" : "rejected";
        if (!error) p.reason = "too far";
        if (error) p.odom_from_pano = Rigid3d(Eigen::Quaterniond::Identity(), {10.0 * i + *error, 0, 0});
        r.result.panoramas.push_back(p);
      }
      r.result.cameras = {{0, Rigid3d(Eigen::Quaterniond::Identity(), {5, 0, 0})}};
      r.result.cameras_odom = r.result.cameras;
      r.result.world_from_odom = Sim3d();
      return r;
    };
    return Evaluate({.runs = {run("r1", 0.25, 0.5), run("r2", 0.125, std::nullopt)},
                     .stations = {{.name = "A", .tag_id = 0}, {.name = "B", .tag_id = 1}}});
  }
  TempDir dir_;
};

TEST_F(EvaluationFiles, TheTableHasRunsAsRowsStationsAsColumnsAndBlanks) {
  const std::vector<ErrorTable> tables = ErrorTables(Example());
  ASSERT_EQ(tables.size(), 1u);
  EXPECT_EQ(tables[0].rows, (std::vector<std::string>{"r1", "r2"}));
  EXPECT_EQ(tables[0].columns, (std::vector<std::string>{"A", "B"}));
  EXPECT_NEAR(*tables[0].cells[0][1], 0.5, 1e-12);
  EXPECT_FALSE(tables[0].cells[1][1]);
  const std::string markdown = FormatMarkdown(tables[0]);
  EXPECT_THAT(markdown, HasSubstr("reference = self"));
  EXPECT_THAT(markdown,
              HasSubstr("| run |    A |    B |\n|-----|-----:|-----:|\n| r1  | 0.25 | 0.50 |\n| r2  | 0.12 |    - |"));
  EXPECT_THAT(FormatCsv(tables[0]), HasSubstr("run,A,B\nr1,0.250000000,0.500000000\nr2,0.125000000,\n"));
}

TEST_F(EvaluationFiles, FeetAreForPeopleOnly) {
  TableOptions feet{.unit = {"ft", 0.3048}};
  const std::vector<ErrorTable> tables = ErrorTables(Example());
  EXPECT_THAT(FormatMarkdown(tables[0], feet), HasSubstr("0.82"));
  WriteEvaluation(Example(), dir_, feet);
  EXPECT_THAT(dir_.Read("errors.csv"), HasSubstr("0.250000000"));
}

TEST_F(EvaluationFiles, WritesErrorsTablesAndSummary) {
  const Evaluation evaluation = Example();
  WriteEvaluation(evaluation, dir_);
  const std::string errors = dir_.Read("errors.csv");
  EXPECT_THAT(errors, HasSubstr("run,variant,method,station,panorama,tag_id,reference,kind,status,reason,error_3d_m,"
                                "error_h_m,error_v_m,de_m,dn_m,du_m,error_rot_deg,sigma_e_m,sigma_n_m,sigma_u_m,nees,"
                                "dof,"));
  EXPECT_THAT(errors,
              HasSubstr("r2,,single,B,\"pano, 1\",1,self,relative,rejected,too far,,,,,,,,,,,,,,,,,,,,,,,,yes,,yes\n"));
  EXPECT_TRUE(fs::exists(dir_ / "table_single_self_relative.csv"));
  EXPECT_THAT(dir_.Read("tables.md"), HasSubstr("3 answers of 4 attempts"));

  const nlohmann::json summary = nlohmann::json::parse(dir_.Read("summary.json"));
  EXPECT_EQ(summary.at("schema"), "trigpoint evaluate 1");
  const nlohmann::json& group = summary.at("groups").at(0);
  EXPECT_EQ(group.at("attempts"), 4);
  EXPECT_EQ(group.at("answers"), 3);
  EXPECT_TRUE(group.at("shares_evidence").get<bool>());
  EXPECT_DOUBLE_EQ(group.at("error_3d").at("over_answers").at("median_m").get<double>(), 0.25);
  EXPECT_DOUBLE_EQ(group.at("error_3d").at("over_attempts").at("median_m").get<double>(), 0.375);
  EXPECT_TRUE(group.at("error_3d").at("over_attempts").at("p90_m").is_null());
  EXPECT_EQ(group.at("reasons").at("rejected: too far"), 1);

  const std::vector<ErrorRow> rows = ReadErrors(dir_ / "errors.csv");
  ASSERT_EQ(rows.size(), evaluation.rows.size());
  EXPECT_EQ(rows[0].panorama, "pano, 0");
  EXPECT_NEAR(*rows[0].error_3d_m, *evaluation.rows[0].error_3d_m, 1e-9);
  EXPECT_NEAR(rows[0].error_enu_m->x(), 0.25, 1e-9);
  EXPECT_FALSE(rows[3].error_3d_m);
}

TEST_F(EvaluationFiles, WhatIsNoAttemptIsReadBackAsNone) {
  Evaluation evaluation = Example();
  evaluation.rows[3].attempt = false;
  WriteEvaluation(evaluation, dir_);
  const std::vector<ErrorRow> rows = ReadErrors(dir_ / "errors.csv");
  for (size_t i = 0; i < rows.size(); ++i) EXPECT_EQ(rows[i].attempt, i != 3) << i;
  // Older files name only the answers that are none.
  const std::string header =
      "run,variant,method,station,panorama,tag_id,reference,kind,status,reason,error_3d_m,error_h_m,error_v_m,de_m,"
      "dn_m,du_m,error_rot_deg,sigma_e_m,sigma_n_m,sigma_u_m,nees,dof\n";
  const std::vector<ErrorRow> old =
      ReadErrors(dir_.Write("old.csv", header + "r1,,single,A,a.jpg,0,self,relative,rejected,,,,,,,,,,,,,\n" +
                                           "r1,,single,B,b.jpg,1,self,relative,no_reference,,,,,,,,,,,,,\n"));
  EXPECT_TRUE(old.at(0).attempt);
  EXPECT_FALSE(old.at(1).attempt);
}

TEST_F(EvaluationFiles, ThePaperPrintsBesideOursOnRequest) {
  EXPECT_THAT(FormatEvaluation(Example()), Not(HasSubstr("12.38")));
  const std::string text = FormatEvaluation(Example(), {.paper_tables = true});
  EXPECT_THAT(text, HasSubstr("12.38"));
  EXPECT_THAT(text, HasSubstr("10.11"));
  EXPECT_THAT(text,
              HasSubstr("3D: 36 answers of 45 attempts; over answers median 1.25, mean 2.14, P90 4.54, max 10.11"));
}

TEST_F(EvaluationFiles, ResultReadersTakeBlanksAndNanAsNotGiven) {
  dir_.Write(
      "panoramas.csv",
      "# trigpoint panoramas 1\n"
      "panorama,station,status,reason,x,y,z,qx,qy,qz,qw,sigma_x_m,sigma_y_m,sigma_z_m,inliers,views,odom_x,odom_y,"
      "odom_z,odom_qx,odom_qy,odom_qz,odom_qw\n"
      "a.jpg,A,localized,,1,2,3,0,0,0,1,0.1,nan,0.3,50,4,4,5,6,0,0,1,0\n"
      "b.jpg,B,unmatched,\"no view, none\",,,,,,,,,,,,,,,,,,,\n");
  const LocalizeResult result = ReadLocalizeResult(dir_);
  ASSERT_EQ(result.panoramas.size(), 2u);
  EXPECT_NEAR(result.panoramas[0].world_from_pano->translation.y(), 2, 1e-12);
  EXPECT_NEAR(result.panoramas[0].odom_from_pano->rotation.z(), 1, 1e-12);
  EXPECT_FALSE(result.panoramas[0].sigma_m);
  EXPECT_FALSE(result.panoramas[1].odom_from_pano);
  EXPECT_EQ(result.panoramas[1].reason, "no view, none");
  EXPECT_TRUE(result.views.empty());
  EXPECT_TRUE(result.cameras.empty());
}

TEST_F(EvaluationFiles, ResultReadersNameWhatIsWrong) {
  EXPECT_THROW(ReadLocalizeResult(dir_), InputError);
  const std::string header = "tag_id,family,size_m,x,y,z,qx,qy,qz,qw\n";
  const auto message = [&](const std::string& rows) -> std::string {
    try {
      ReadTagResults(dir_.Write("tags.csv", header + rows));
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_THAT(message("1,tag36h11,0.5,1,2,3,0,0,0,1\n1,tag36h11,0.5,1,2,3,0,0,0,1\n"), HasSubstr("tags.csv:3"));
  EXPECT_THAT(message("1,tag36h11,0.5,1,2,3,0,0,0,2\n"), HasSubstr("no unit quaternion"));
  EXPECT_THAT(message("1,tag36h11,0.5,1,east,3,0,0,0,1\n"), HasSubstr("column y"));
  EXPECT_EQ(message("1,tag36h11,0.5,1,2,3,0,0,0,1\n"), "");
}

TEST_F(EvaluationFiles, TagCovariancesAreOfTheDiagonalBlocks) {
  std::string columns = "tag_a,tag_b", diagonal = "7,7", other = "7,8";
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      columns += ",c" + std::to_string(i) + std::to_string(j);
      diagonal += i == j ? "," + std::to_string(i + 1) : ",0";
      other += ",9";
    }
  }
  dir_.Write("tags_cov.csv", columns + "\n" + diagonal + "\n" + other + "\n");
  dir_.Write("tags.csv", "tag_id,x,y,z,qx,qy,qz,qw,sigma_rx_deg,sigma_ry_deg,sigma_rz_deg\n7,1,2,3,0,0,0,1,180,0,0\n");
  const auto tags = ReadTagResults(dir_ / "tags.csv", dir_ / "tags_cov.csv");
  ASSERT_TRUE(tags.at(0).covariance);
  EXPECT_DOUBLE_EQ((*tags[0].covariance)(5, 5), 6);
  EXPECT_NEAR(tags[0].sigma_rot_rad->x(), 3.14159265358979, 1e-12);
}

}  // namespace
}  // namespace trigpoint
