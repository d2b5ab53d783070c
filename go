#!/usr/bin/env bash
# One command from a fresh clone on Debian 12 to a running program.
#   ./go demo [arguments of islet view]  1,000 cubes pour through an hourglass; leaves a page that shows them in a browser
#   ./go test [arguments of ctest]       every test
#   ./go build                           the same without running anything
#   ./go install                         only the packages
# Packages are installed with apt-get, and only those that are missing.
set -euo pipefail
cd "$(dirname "$0")"

packages=(
  g++ cmake ninja-build
  libeigen3-dev libtbb-dev libfcl-dev libsuitesparse-dev
  libbenchmark-dev libgtest-dev librapidcheck-dev libhdf5-dev
  libcli11-dev nlohmann-json3-dev libfmt-dev zlib1g-dev libzstd-dev libtinygltf-dev libassimp-dev libcairo2-dev libcpp-httplib-dev
  pybind11-dev python3-dev python3-numpy
)

say() { printf '\n== %s\n' "$*"; }
die() { printf 'go: %s\n' "$*" >&2; exit 1; }

installed() { dpkg -s "$1" 2>/dev/null | grep -q '^Status: install ok installed$'; }

install_packages() {
  command -v dpkg >/dev/null || { say "no dpkg here: expecting the libraries of README.md to be installed"; return; }
  local missing=() package
  for package in "${packages[@]}"; do
    installed "$package" || missing+=("$package")
  done
  if ((${#missing[@]} == 0)); then return; fi
  say "installing ${missing[*]}"
  local as_root=()
  if ((EUID != 0)); then
    command -v sudo >/dev/null || die "these packages are missing, and there is neither root nor sudo: ${missing[*]}"
    as_root=(sudo)
  fi
  local apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -o Acquire::Retries=3)
  "${apt[@]}" update || die "apt-get update failed"
  "${apt[@]}" install -y --no-install-recommends "${missing[@]}" || die "apt-get could not install: ${missing[*]}"
}

# build [target]: everything, or that alone.
build() {
  install_packages
  say "configuring build/release"
  cmake --preset release
  say "building ${1:-everything} with $(nproc) jobs: ${2:-6 minutes on two cores}"
  cmake --build build/release -j"$(nproc)" ${1:+--target "$1"}
}

command=${1:-}
if (($#)); then shift; fi
case $command in
  demo)
    build islet_program "160 seconds on two cores"
    page=
    if [[ ${1:--} == -* ]]; then set -- cubeglass "$@"; fi
    if [[ " $* " != *" --out"* && " $* " != *" --live"* ]]; then
      page=build/$(basename "$1" .json).html
      set -- "$@" --out "$page"
    fi
    say "islet view $*"
    build/release/scenes/islet view "$@"
    if [[ $page ]]; then say "open it in a browser: file://$PWD/$page"; fi
    ;;
  test)
    build
    say "running every test"
    exec ctest --test-dir build/release --output-on-failure --no-tests=error -j"$(nproc)" "$@"
    ;;
  build) build ;;
  install) install_packages ;;
  *)
    sed -n '2,7s/^# \{0,1\}//p' "$0" >&2
    exit 2
    ;;
esac
