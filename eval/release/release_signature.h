// Signatures of a release's record, made and checked by OpenSSH's and GnuPG's own programs: release.json.sig or
// release.json.asc.
#pragma once

#include <filesystem>
#include <string>

#include "calib/base/progress.h"

namespace trigpoint {

// `key`: the file of an SSH key (private, or public with its private half in the agent), "gpg:KEY", or empty: the first
// key in ~/.ssh that is there. A passphrase is asked for on the terminal. Throws OptionError for a key that is not
// there, InputError with the program's own words when it does not sign.
void SignRelease(const std::filesystem::path& release, const std::string& key, const CancelToken& cancel);

struct Signature {
  enum class State { kNone, kHolds, kBroken };
  State state = State::kNone;
  std::string key;          // "ED25519 key SHA256:...", the fingerprint of an OpenPGP key
  std::string signer;       // as the list of signers, or the OpenPGP key, names it; empty: not known
  bool is_trusted = false;  // the key is among `signers`
  std::string reason;       // why it does not hold
};
// `signers`: whose signature counts: an SSH public key, an allowed_signers file (ssh-keygen(1)), or a file with OpenPGP
// public keys; empty: any. With them a signature of somebody else is broken. Throws InputError if the program to check
// it with is not installed.
Signature CheckSignature(const std::filesystem::path& release, const std::string& signers, const CancelToken& cancel);

}  // namespace trigpoint
