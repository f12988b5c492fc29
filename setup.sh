#!/usr/bin/env bash
# Sets Trigpoint up on Debian 12 and uses it. Run it again at any time: what is done is not done twice.
#
#   ./setup.sh            installs the packages that are missing and builds Release
#   ./setup.sh demo [DIR] the same, then runs the example site (default ./trigpoint-demo)
#   ./setup.sh test       the same with the tests, then ctest and clang-format
#   ./setup.sh nightly    the same, then what takes hours: the long tests, the example site in an empty folder, all
#                         tests with AddressSanitizer, the fuzz targets for 10 minutes each (FUZZ_SECONDS)
#   ./setup.sh package    the same as test without running them, then Debian packages in build/release
#   ./setup.sh lint       the same, then clang-tidy over the product's sources (half an hour the first time)
#
# It names its steps; what their commands print is in build/setup.log, whose end is shown if one fails.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

packages=(
  build-essential cmake ninja-build ccache pkg-config git clang-format-14 clang-tidy-14 python3 python3-numpy
  python3-pil python3-yaml
  libeigen3-dev libceres-dev libboost-dev libopencv-dev libopencv-contrib-dev libopengv-dev libapriltag-dev libgeographiclib-dev
  libexiv2-dev libexpat1-dev libjpeg-dev libtiff-dev
  libyaml-cpp-dev nlohmann-json3-dev libsqlite3-dev libssl-dev libfmt-dev libspdlog-dev libcli11-dev
  libvtk9-dev libgdal-dev libglew-dev libegl-dev libgl1-mesa-dri libpango1.0-dev fonts-dejavu-core
  libproj-dev libheif-dev libcurl4-openssl-dev libbz2-dev zlib1g-dev liblz4-dev libzstd-dev ca-certificates poppler-utils file openssh-client gnupg
  qtbase5-dev libqt5opengl5-dev libvtk9-qt-dev xvfb qttools5-dev-tools
  libgtest-dev libgmock-dev
)
# The Debian release these packages were chosen from.
release=12
log=$PWD/build/setup.log
tail_lines=30

say() { echo "setup.sh: $*"; }
fail() { echo "setup.sh: $*" >&2; exit 1; }

# step TEXT COMMAND...: says TEXT, runs the command with its output in the log, and says how long it took.
step() {
  local text=$1 begin=$SECONDS
  shift
  say "$text"
  { echo "== $text: $*"; date; } >>"$log"
  if ! "$@" >>"$log" 2>&1 </dev/null; then
    # What a test expected is far above ctest's summary in the log.
    grep -A 6 -E ': Failure$|^(AssertionError|Traceback)' "$log" | tail -n $((2 * tail_lines)) >&2 || true
    echo "setup.sh: failed: $text. The last $tail_lines lines of $log:" >&2
    tail -n "$tail_lines" "$log" >&2
    exit 1
  fi
  if ((SECONDS - begin >= 5)); then say "  done in $((SECONDS - begin)) s"; fi
}

install_packages() {
  local missing=() package
  local installed
  installed=" $(dpkg-query -W -f='${db:Status-Status} ${Package} ' 2>/dev/null || true)"
  for package in "${packages[@]}"; do
    [[ $installed == *" installed $package "* ]] || missing+=("$package")
  done
  if [[ ${#missing[@]} -eq 0 ]]; then
    say "all ${#packages[@]} packages are installed"
    return
  fi
  command -v apt-get >/dev/null || fail "packages are installed with apt-get, which is not here; install by hand: ${missing[*]}"
  local version=unknown
  [[ -r /etc/os-release ]] && version=$(. /etc/os-release && echo "${ID:-}${VERSION_ID:-}")
  [[ $version == debian$release ]] || say "this is $version, not debian$release: versions may differ" >&2
  local as_root=(env DEBIAN_FRONTEND=noninteractive)
  if [[ $EUID -ne 0 ]]; then
    command -v sudo >/dev/null || fail "missing packages need root: run 'su -c ./setup.sh' once, or install sudo. Missing: ${missing[*]}"
    # The password is asked for here, where it can be seen.
    sudo -v || fail "missing packages need root, and sudo refused. Missing: ${missing[*]}"
    as_root=(sudo "${as_root[@]}")
  fi
  step "reading the package lists" "${as_root[@]}" apt-get update -q
  step "installing ${#missing[@]} of ${#packages[@]} packages" \
    "${as_root[@]}" apt-get install -q -y --no-install-recommends "${missing[@]}"
}

# build PRESET [target...]: everything without one.
build() {
  local preset=$1
  shift
  step "configuring build/$preset" cmake --preset "$preset"
  step "building ${*:-everything} in build/$preset (minutes the first time; watch it with: tail -f build/setup.log)" \
    cmake --build --preset "$preset" -j "$(nproc)" ${1:+--target "$@"}
}

# tests DIR ARGUMENT...: ctest in build/DIR, its summary shown.
tests() {
  local dir=$1
  shift
  step "testing build/$dir" ctest --test-dir "build/$dir" --output-on-failure -j "$(nproc)" "$@"
  grep -E '^[0-9]+% tests passed|^Total Test time' "$log" | tail -n 2
}

demo_from_nothing() {
  local dir
  dir=$(mktemp -d)
  (cd "$dir" && "$OLDPWD/build/release/bin/trigpoint" demo site) && rm -rf "$dir"
}

fuzz() {
  local seconds=${FUZZ_SECONDS:-600} target corpus
  step "configuring build/fuzz" cmake -S . -B build/fuzz -G Ninja -DCMAKE_BUILD_TYPE=Release -DTRIGPOINT_FUZZ=ON \
    -DCMAKE_C_COMPILER=clang-14 -DCMAKE_CXX_COMPILER=clang++-14
  local targets=()
  for corpus in tests/fuzz/corpus/*/; do targets+=("fuzz_$(basename "$corpus")"); done
  step "building ${#targets[@]} fuzz targets" cmake --build build/fuzz -j "$(nproc)" --target "${targets[@]}"
  for target in "${targets[@]}"; do
    # What it finds stays in build/fuzz; the corpus in the tree is only read.
    mkdir -p "build/fuzz/found/$target"
    step "$target for $seconds s" "build/fuzz/bin/$target" -max_total_time="$seconds" \
      -artifact_prefix="build/fuzz/$target-" "build/fuzz/found/$target" "tests/fuzz/corpus/${target#fuzz_}"
  done
}

command=${1:-build}
[[ $# -gt 0 ]] && shift
case $command in
  -h | --help)
    sed -n '2,/^set/s/^# \{0,1\}//p' "$0"
    exit
    ;;
  build | demo | test | nightly | lint | package) ;;
  *) fail "unknown command '$command': expected nothing, demo, test, nightly, package or lint (see --help)" ;;
esac

mkdir -p build
: >"$log"
[[ $command == nightly ]] && packages+=(clang-14 libclang-rt-14-dev)
# A cluster for the tests of `trigpoint batch`.
[[ $command == test || $command == nightly ]] && packages+=(slurm-wlm munge)
install_packages
case $command in
  build)
    build release trigpoint trigpoint-desktop
    say "built $PWD/build/release/bin/trigpoint"
    ;;
  demo)
    build release trigpoint
    exec build/release/bin/trigpoint demo "$@"
    ;;
  test)
    build release
    tests release -LE 'lint|nightly' "$@"
    ;;
  nightly)
    build release
    tests release -LE lint
    step "the example site in an empty folder" demo_from_nothing
    build asan
    tests asan -LE lint
    fuzz
    say "nightly: everything passed"
    ;;
  lint)
    build release
    tests release -L lint "$@"
    ;;
  package)
    build release
    step "packing" env -C build/release cpack
    ls build/release/*.deb
    ;;
esac
