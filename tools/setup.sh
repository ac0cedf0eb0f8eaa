#!/bin/sh
# Makes a fresh clone ready: system libraries, a virtual environment in .venv, and the project in it.
#
#   tools/setup.sh run    what the program needs
#   tools/setup.sh test   that, and what the tests need
#
# Does nothing, quickly, when all of it was done before. PYTHON=/path/to/python3.12 chooses the interpreter.
set -eu
cd "$(dirname "$0")/.."
goal=${1:-run}

# OpenGL without and with a display, and the X libraries that the window loads.
packages="libegl1 libgl1 libgl1-mesa-dri libx11-6 libxext6"
# The window tests draw on a virtual display and press real keys there.
[ "$goal" = test ] && packages="$packages xvfb xauth xdotool"

say() { echo "setup: $*"; }
stop() { echo "setup: error: $*" >&2; exit 1; }

# Whether $1 is a Python of a supported version that can make virtual environments.
suitable() {
    command -v "$1" >/dev/null 2>&1 &&
        "$1" -c 'import sys, venv, ensurepip; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null
}

find_python() {
    for python in ${PYTHON:-python3.13 python3.12 python3.11 python3 python}; do
        if suitable "$python"; then
            return 0
        fi
    done
    return 1
}

# Installs Debian packages, as root or through sudo; otherwise names them and stops.
install() {
    if [ "$(id -u)" = 0 ]; then
        as_root=
    elif command -v sudo >/dev/null && { sudo -n true 2>/dev/null || [ -t 0 ]; }; then
        as_root=sudo
    else
        stop "these packages are missing, and installing them takes root: apt-get install $*"
    fi
    say "installing $*"
    log=$(mktemp)
    if ! { $as_root apt-get update &&
        $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "$@"; } >"$log" 2>&1; then
        tail -n 20 "$log" >&2
        stop "apt-get could not install $*, see above; the whole log is $log"
    fi
    rm -f "$log"
}

debian() { command -v apt-get >/dev/null && command -v dpkg-query >/dev/null; }

state="$(pwd) $(cksum pyproject.toml tools/setup.sh | tr '\n' ' ')"
for stamp in .venv/.ready-test ".venv/.ready-$goal"; do
    if [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$state" ] && .venv/bin/python -c '' 2>/dev/null; then
        exit 0
    fi
done

if debian; then
    missing=
    for package in $packages; do
        # A library may be there under a newer name (libgl1t64), which provides the old one.
        if ! dpkg-query -W -f '${Status} ${Package} ${Provides}\n' 2>/dev/null |
            grep '^install ok installed' | tr ',' ' ' | grep -qw -- "$package"; then
            missing="$missing $package"
        fi
    done
    if ! .venv/bin/python -c '' 2>/dev/null && ! find_python && [ -z "${PYTHON:-}" ]; then
        missing="$missing python3 python3-venv"
    fi
    # shellcheck disable=SC2086  # one word for each package
    [ -z "$missing" ] || install $missing
elif [ "$(uname)" = Linux ]; then
    ldconfig=$(command -v ldconfig || echo /sbin/ldconfig)
    for library in libEGL.so.1 libGL.so.1 libX11.so.6 libXext.so.6; do
        "$ldconfig" -p | grep -q "$library" || stop "$library is missing; install your system's packages for EGL, GL and X11" \
            "(Fedora: mesa-libEGL mesa-libGL mesa-dri-drivers libX11 libXext, Arch: mesa libglvnd libx11 libxext)"
    done
    if [ "$goal" = test ] && ! { command -v Xvfb && command -v xdotool; } >/dev/null; then
        say "Xvfb or xdotool is missing: the tests of the window will be skipped"
    fi
fi

if ! .venv/bin/python -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null; then
    find_python || stop "no Python 3.11, 3.12 or 3.13 with the venv module was found;" \
        "install one, and name it if it is not on the PATH: make PYTHON=/path/to/python3.12 $goal"
    say "making .venv with $("$python" --version)"
    "$python" -m venv --clear .venv
fi
say "installing the project and its dependencies into .venv"
.venv/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[draco,formats,test,dev]'
rm -f .venv/.ready-*
echo "$state" >"$stamp"
