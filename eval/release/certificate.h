// The page of a release that a person signs: who, when, with what, in which system, how accurate, and the limits of
// use.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "eval/release/publish.h"

namespace trigpoint {

// Writes certificate.html, certificate.pdf and certificate.json into the half-made release `release`, from its record
// and its map/ and evaluate/. Accuracy is that at check points and of answers that share no evidence with what they are
// held against: residuals of control are never stated as accuracy; where nothing was checked, the page states that.
void WriteCertificate(const Project& project, const nlohmann::json& record, const ReleaseStatement& statement,
                      const std::filesystem::path& release);

}  // namespace trigpoint
