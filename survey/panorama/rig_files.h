// rig.csv and rig.json: the rig as files, as datasets/io/rig_file.h reads them.
#pragma once

#include <filesystem>

#include "survey/panorama/composite.h"
#include "survey/panorama/stitch.h"

namespace trigpoint {

// rig.csv: rig_from_cam of every placed photo. rig.json: what it leaves out: lens, covariance, why a photo is not
// placed, parallax, closure, levelling. `composite` may be null. Throws IoError.
void WriteRigFiles(const StitchedRig& rig, const Composite* composite, const std::filesystem::path& dir);

// pairs.csv: photos that were found to overlap, with their matches. Throws IoError.
void WritePairs(const StitchedRig& rig, const std::filesystem::path& dir);

// Matches kept apart: held_out.csv (photo_a,photo_b,u_a,v_a,u_b,v_b), with where the rig, its rotations alone, and the
// distances of the points nearby predict (u_b, v_b).
void WriteHeldOut(const StitchedRig& rig, const std::filesystem::path& dir);

}  // namespace trigpoint
