// Retrieval: a picture of the same spots comes first, whatever the number of threads.
#include "localize/references/retrieval.h"

#include <gtest/gtest.h>

#include "tests/localize/test_scene.h"

namespace trigpoint {
namespace {

// 200 of the spots [first, first + 300), as one picture shows them.
DescriptorBlock Picture(uint64_t first, uint64_t picture) {
  cv::Mat rows(200, 128, CV_8U);
  Random random(picture);
  for (int i = 0; i < rows.rows; ++i) {
    test::FillDescriptor(first + static_cast<uint64_t>(random.Below(300)), picture, rows.ptr<uint8_t>(i));
  }
  return DescriptorBlock(rows);
}

TEST(Retrieval, FindsThePlace) {
  constexpr int kPlaces = 40;
  RetrievalOptions options;
  options.words = 1000;
  DescriptorBlock training;
  std::vector<DescriptorBlock> documents;
  for (uint64_t p = 0; p < kPlaces; ++p) {
    documents.push_back(Picture(1000 * p, p));
    for (int i = 0; i < documents.back().size(); ++i) training.Append(documents.back(), i);
  }
  std::vector<std::vector<RetrievalHit>> answers;
  for (int threads : {1, 2}) {
    const Vocabulary vocabulary(training, options, 1, threads, {});
    EXPECT_GT(vocabulary.size(), 300);
    RetrievalIndex index(vocabulary);
    for (const DescriptorBlock& d : documents) index.Add(d);
    index.Finish();
    EXPECT_EQ(index.size(), kPlaces);
    int first = 0;
    for (uint64_t p = 0; p < kPlaces; ++p) {
      const std::vector<RetrievalHit> hits = index.Query(Picture(1000 * p, 500 + p), 5);
      ASSERT_FALSE(hits.empty());
      EXPECT_LE(hits.size(), 5U);
      for (size_t k = 1; k < hits.size(); ++k) EXPECT_GE(hits[k - 1].score, hits[k].score);
      first += hits[0].document == static_cast<int>(p);
      answers.push_back(hits);
    }
    EXPECT_EQ(first, kPlaces);
  }
  for (size_t p = 0; p < kPlaces; ++p) {
    ASSERT_EQ(answers[p].size(), answers[p + kPlaces].size());
    for (size_t k = 0; k < answers[p].size(); ++k) {
      EXPECT_EQ(answers[p][k].document, answers[p + kPlaces][k].document);
      EXPECT_EQ(answers[p][k].score, answers[p + kPlaces][k].score);
    }
  }
}

TEST(Retrieval, APictureOfNothingHasNoPlace) {
  DescriptorBlock training = Picture(0, 1);
  RetrievalOptions options;
  options.words = 64;
  const Vocabulary vocabulary(training, options, 1, 1, {});
  RetrievalIndex index(vocabulary);
  index.Add(training);
  index.Finish();
  EXPECT_TRUE(index.Query(DescriptorBlock(), 5).empty());
}

}  // namespace
}  // namespace trigpoint
