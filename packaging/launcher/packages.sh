# Installs what is missing from the distribution's packages, or says what to install. Sourced by ./talbot; runs before there is
# a Python. Quick when nothing is missing: one dpkg-query.

# Names are the same in Debian 12 and 13 (and in Ubuntu); versions differ: Embree 3 or 4, OpenImageIO 2.4 or 2.5, ...
talbot_build_packages="cmake ninja-build g++ pkg-config libembree-dev libopenimageio-dev openimageio-tools libopencolorio-dev
  libosd-dev libimath-dev libopenexr-dev libopenvdb-dev libboost-dev libtbb-dev pybind11-dev python3 python3-dev python3-venv
  python3-pip python3-numpy python3-pytest libgtest-dev"

# What `./talbot package` builds its libraries from, beside their sources.
talbot_bundle_packages="nasm libboost-thread-dev libfmt-dev robin-map-dev"

talbot_wanted_packages() {
  local command=${1-help} word which=system
  for word in "$@"; do
    if [ "$which" = next ]; then which=$word; fi
    if [ "$word" = --blender ]; then which=next; fi
    if [ "$word" = -- ]; then break; fi
  done
  case $command in
    render | blender | ui | bench | test | doctor | package) echo "$talbot_build_packages" ;;
    *) echo python3 && return ;;
  esac
  if { [ "$which" = system ] && [ "$command" != package ]; } || [ "$command" = test ]; then echo blender; fi
  if [ "${which#bpy-}" != "$which" ] || [ "$command" = test ]; then
    # What the official builds expect of the system.
    echo libx11-6 libxrender1 libxxf86vm1 libxfixes3 libxi6 libxkbcommon0 libsm6 libice6 libgl1 libegl1
  fi
  case $command in package | test) echo "$talbot_bundle_packages" ;; esac
  if [ "$command" = test ]; then
    # The engine is compiled for this machine and for the packages, mostly from the same text: ccache does it once.
    echo ccache clang-format xvfb xauth
    case " $* " in *" --sanitize "*) echo clang libclang-rt-dev ;; esac
  fi
}

talbot_missing_packages() {
  local package
  # Purged and never-installed packages alike have no line that ends in "installed".
  local installed
  installed=" $(dpkg-query -W -f='${Package} ${db:Status-Status}\n' "$@" 2>/dev/null | sed -n 's/ installed$//p' | tr '\n' ' ')"
  for package in "$@"; do
    case $installed in *" $package "*) ;; *) echo "$package" ;; esac
  done
}

# Elsewhere the names differ: ask for the programs and headers themselves.
talbot_missing_elsewhere() {
  local program header
  for program in cmake ninja g++ pkg-config python3; do
    command -v "$program" >/dev/null || echo "$program"
  done
  for header in "embree[34]/rtcore.h" OpenImageIO/imageio.h OpenColorIO/OpenColorIO.h opensubdiv/bfr/surface.h pybind11/pybind11.h gtest/gtest.h; do
    compgen -G "/usr/include/$header" >/dev/null || compgen -G "/usr/local/include/$header" >/dev/null || echo "$header"
  done
}

talbot_ensure_packages() {
  local wanted missing
  wanted=$(talbot_wanted_packages "$@")
  if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
    [ "$wanted" = python3 ] || missing=$(talbot_missing_elsewhere)
    if [ -n "${missing-}" ]; then
      echo "This is not Debian, so nothing was installed. Please install (development packages, with headers):" $missing >&2
      exit 1
    fi
    return 0
  fi
  # shellcheck disable=SC2086
  missing=$(talbot_missing_packages $wanted | tr '\n' ' ')
  [ -n "$missing" ] || return 0
  if [ "$(id -u)" != 0 ]; then
    printf 'These packages are missing:\n  %s\nInstall them as root:\n  apt-get install --no-install-recommends %s\n' "$missing" "$missing" >&2
    exit 1
  fi
  echo "Installing from the distribution: $missing" >&2
  local log
  log=$(mktemp)
  # shellcheck disable=SC2086
  if ! { apt-get update -q && DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends $missing; } </dev/null >"$log" 2>&1; then
    tail -n 30 "$log" >&2
    printf 'apt-get could not install them (the whole log is %s). Needed are:\n  %s\n' "$log" "$missing" >&2
    exit 1
  fi
  rm -f "$log"
}
