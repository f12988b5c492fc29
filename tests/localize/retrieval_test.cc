// Retrieval: a picture of the same spots comes first, whatever the number of threads.
#include "localize/references/retrieval.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>

#include "tests/localize/test_scene.h"
#include "tests/support/temp_dir.h"

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
  CodebookOptions options;
  options.words = 1000;
  const auto descriptors = [](int p) { return Picture(1000 * static_cast<uint64_t>(p), static_cast<uint64_t>(p)); };
  std::vector<std::vector<RetrievalHit>> answers;
  for (int threads : {1, 2}) {
    const RetrievalIndex index = IndexInMemory(kPlaces, descriptors, options, 1, threads, {});
    EXPECT_GT(index.words(), 300);
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

TEST(Retrieval, TheOnlyPlaceIsFound) {
  CodebookOptions options;
  options.words = 64;
  const RetrievalIndex index = IndexInMemory(1, [](int) { return Picture(0, 1); }, options, 1, 1, {});
  const std::vector<RetrievalHit> hits = index.Query(Picture(0, 2), 5);
  ASSERT_EQ(hits.size(), 1U);
  EXPECT_GT(hits[0].score, 0.5F);
}

TEST(Retrieval, APictureOfNothingHasNoPlace) {
  CodebookOptions options;
  options.words = 64;
  const RetrievalIndex index = IndexInMemory(1, [](int) { return Picture(0, 1); }, options, 1, 1, {});
  EXPECT_TRUE(index.Query(DescriptorBlock(), 5).empty());
}

class RetrievalFiles : public testing::Test {
 protected:
  RetrievalFiles() {
    vocabulary_.Write(dir_ / "codebook.bin");
    for (int part = 0; part < 3; ++part) WriteWordLists(Part(part), vocabulary_, File(part));
  }
  static DescriptorBlock PictureOf(int place) {
    return Picture(1000 * static_cast<uint64_t>(place), static_cast<uint64_t>(place));
  }
  static CodebookOptions Options() {
    CodebookOptions options;
    options.words = 500;
    return options;
  }
  // Every third picture; the last part has none.
  WordLists Part(int part) const {
    WordListBuilder builder(vocabulary_.size());
    for (int p = part; p < kPlaces && part < 2; p += 2)
      builder.Add(CountWords(vocabulary_, PictureOf(p)), "place " + std::to_string(p));
    return std::move(builder).Finish();
  }
  std::filesystem::path File(int part) const { return dir_ / (std::to_string(part) + ".bin"); }
  std::string Damage(const std::function<void(std::string*)>& how) {
    std::ifstream in(File(0), std::ios::binary);
    std::string bytes((std::istreambuf_iterator<char>(in)), {});
    how(&bytes);
    const std::filesystem::path file = dir_ / "damaged.bin";
    std::ofstream(file, std::ios::binary) << bytes;
    try {
      RetrievalIndex(std::make_shared<const Vocabulary>(vocabulary_), {MapWordLists(file, vocabulary_)});
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }

  static constexpr int kPlaces = 20;
  TempDir dir_;
  Vocabulary vocabulary_ = TrainVocabulary(kPlaces, PictureOf, Options(), 1, 1, {});
};

// Parts that are mapped from files give what one index in memory gives, whatever is in which part.
TEST_F(RetrievalFiles, PartsOnDiskAnswerAsOneInMemory) {
  auto vocabulary = std::make_shared<const Vocabulary>(Vocabulary::Read(dir_ / "codebook.bin"));
  EXPECT_EQ(vocabulary->fingerprint(), vocabulary_.fingerprint());
  std::vector<WordLists> parts;
  for (int part = 0; part < 3; ++part) parts.push_back(MapWordLists(File(part), *vocabulary));
  const RetrievalIndex mapped(vocabulary, std::move(parts));
  const RetrievalIndex whole = IndexInMemory(kPlaces, PictureOf, Options(), 1, 1, {});
  ASSERT_EQ(mapped.size(), kPlaces);
  for (int p = 0; p < kPlaces; ++p) {
    const DescriptorBlock query = Picture(1000 * static_cast<uint64_t>(p), 700 + static_cast<uint64_t>(p));
    const std::vector<RetrievalHit> a = mapped.Query(query, 3), b = whole.Query(query, 3);
    ASSERT_FALSE(b.empty());
    EXPECT_EQ(mapped.Name(a.front().document), "place " + std::to_string(b.front().document));
    EXPECT_NEAR(a.front().score, b.front().score, 1e-5);
    std::vector<char> others(kPlaces, 1);
    others[static_cast<size_t>(a.front().document)] = 0;
    for (const RetrievalHit& hit : mapped.Query(query, kPlaces, others)) EXPECT_NE(hit.document, a.front().document);
  }
}

TEST_F(RetrievalFiles, DamagedListsAreRefused) {
  EXPECT_EQ(Damage([](std::string*) {}), "");
  EXPECT_THAT(Damage([](std::string* s) { s->resize(20); }), testing::HasSubstr("too short"));
  EXPECT_THAT(Damage([](std::string* s) { s->pop_back(); }), testing::HasSubstr("another length"));
  EXPECT_THAT(Damage([](std::string* s) { s->front() = 'x'; }), testing::HasSubstr("another format"));
  EXPECT_THAT(Damage([](std::string* s) { (*s)[40] ^= 1; }), testing::HasSubstr("another codebook"));
  EXPECT_THAT(Damage([](std::string* s) { (*s)[64] = '\xff'; }), testing::HasSubstr("overlap"));
  // The first posting names a document that is not there.
  const size_t postings = 56 + 8 * (static_cast<size_t>(vocabulary_.size()) + 1);
  EXPECT_THAT(Damage([&](std::string* s) { (*s)[postings + 3] = '\x7f'; }), testing::HasSubstr("not there"));
}

TEST_F(RetrievalFiles, ADamagedCodebookIsRefused) {
  const std::filesystem::path file = dir_ / "codebook.bin";
  std::filesystem::resize_file(file, std::filesystem::file_size(file) - 1);
  EXPECT_THROW(Vocabulary::Read(file), InputError);
  EXPECT_THROW(Vocabulary::Read(dir_ / "none.bin"), InputError);
}

}  // namespace
}  // namespace trigpoint
