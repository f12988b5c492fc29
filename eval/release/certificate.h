// The page of a release that a person signs: who, when, with what, in which system, how accurate, and the limits of
// use.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "datasets/project/project.h"

namespace trigpoint {

// What only a person knows, for the certificate; empty: not stated.
struct ReleaseStatement {
  std::string author;      // who is responsible for it
  std::string instrument;  // what the control was measured with
  std::string note;
};

// Writes certificate.html, certificate.pdf and certificate.json into the half-made release `release`, from its record
// and its map/ and evaluate/. Accuracy is that at check points and of answers that share no evidence with what they are
// held against: residuals of control are never stated as accuracy; where nothing was checked, the page states that.
void WriteCertificate(const Project& project, const nlohmann::json& record, const ReleaseStatement& statement,
                      const std::filesystem::path& release);

}  // namespace trigpoint
