#!/usr/bin/env bash
# Sets Trigpoint up on Debian 12 and uses it. Run it again at any time: what is done is not done twice.
#
#   ./setup.sh            installs the packages that are missing and builds Release
#   ./setup.sh demo [DIR] the same, then runs the example site (default ./trigpoint-demo) to its tables
#   ./setup.sh test       the same with the tests, then ctest and clang-format
#   ./setup.sh package    the same, then Debian packages in build/release
#   ./setup.sh lint       the same, then clang-tidy over the product's sources (half an hour the first time)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

packages=(
  build-essential cmake ninja-build ccache pkg-config git clang-format-14 clang-tidy-14 python3 python3-numpy
  libeigen3-dev libceres-dev libopencv-dev libopencv-contrib-dev libopengv-dev libapriltag-dev libgeographiclib-dev
  libexiv2-dev libexpat1-dev libjpeg-dev libtiff-dev
  libyaml-cpp-dev nlohmann-json3-dev libsqlite3-dev libssl-dev libfmt-dev libspdlog-dev libcli11-dev
  libvtk9-dev libgdal-dev libglew-dev libegl-dev libgl1-mesa-dri libpango1.0-dev fonts-dejavu-core
  libproj-dev libheif-dev file
  qtbase5-dev libqt5opengl5-dev libvtk9-qt-dev xvfb
  libgtest-dev libgmock-dev
)
# The Debian release these packages were chosen from.
release=12

fail() { echo "setup.sh: $*" >&2; exit 1; }

install_packages() {
  local missing=() package
  local installed
  installed=" $(dpkg-query -W -f='${db:Status-Status} ${Package} ' 2>/dev/null || true)"
  for package in "${packages[@]}"; do
    [[ $installed == *" installed $package "* ]] || missing+=("$package")
  done
  [[ ${#missing[@]} -eq 0 ]] && return
  command -v apt-get >/dev/null || fail "packages are installed with apt-get, which is not here; install by hand: ${missing[*]}"
  local version=unknown
  [[ -r /etc/os-release ]] && version=$(. /etc/os-release && echo "${ID:-}${VERSION_ID:-}")
  [[ $version == debian$release ]] || echo "setup.sh: this is $version, not debian$release: versions may differ" >&2
  local as_root=()
  if [[ $EUID -ne 0 ]]; then
    command -v sudo >/dev/null || fail "missing packages need root: run 'su -c ./setup.sh' once, or install sudo. Missing: ${missing[*]}"
    as_root=(sudo)
  fi
  echo "setup.sh: installing ${missing[*]}"
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get update -q
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${missing[@]}"
}

# build [target...]: everything without one.
build() {
  cmake --preset release >build-configure.log 2>&1 || { cat build-configure.log >&2; rm -f build-configure.log; exit 1; }
  rm -f build-configure.log
  cmake --build --preset release -j "$(nproc)" ${1:+--target "$@"}
}

command=${1:-build}
[[ $# -gt 0 ]] && shift
case $command in
  build)
    install_packages
    build trigpoint trigpoint-desktop
    echo "setup.sh: built $PWD/build/release/bin/trigpoint"
    ;;
  demo)
    install_packages
    build trigpoint
    exec build/release/bin/trigpoint demo "$@"
    ;;
  test)
    install_packages
    build
    ctest --preset release -j "$(nproc)" -LE lint "$@"
    ;;
  lint)
    install_packages
    build
    ctest --preset release -L lint "$@"
    ;;
  package)
    install_packages
    build
    (cd build/release && cpack)
    ;;
  -h | --help) sed -n '2,8s/^# \{0,1\}//p' "$0" ;;
  *) fail "unknown command '$command': expected nothing, demo, test, package or lint (see --help)" ;;
esac
