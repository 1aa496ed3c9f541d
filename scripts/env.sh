# shellcheck shell=bash
# Sourced by the other scripts: makes .venv once for each state of the lock files, then activates it.
#   env_make run   what the program needs
#   env_make dev   the same, and what the tests and linters need
#   env_make docs  what the site of the documents needs

# The tests start the program hundreds of times: without its caches each process would compile it anew.
unset PYTHONDONTWRITEBYTECODE

# Prints the Python to use. That of a distribution is built with profile-guided optimisation, unlike pyenv's: tests and
# planning take a sixth less time.
env_find_python() {
    local python
    for python in /usr/bin/python3 python3.11 python3.12 python3.13 python3.14; do
        if "$python" -c 'import ensurepip, sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            echo "$python"
            return
        fi
    done
    echo python3
}

env_make() {
    local kind=$1 root python stamp wanted
    root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
    python=${FAULTLINE_PYTHON:-$(env_find_python)}
    "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || {
        echo "faultline needs Python 3.11 or newer; set FAULTLINE_PYTHON to one" >&2
        return 2
    }
    stamp="$root/.venv/.faultline-$kind"
    wanted=$(cat "$root"/requirements*.lock "$root/pyproject.toml" | cksum)
    if [ "$(cat "$stamp" 2>/dev/null)" != "$wanted" ]; then
        echo "faultline: making the environment in .venv ($kind); this takes a minute or two" >&2
        [ -x "$root/.venv/bin/python" ] || "$python" -m venv "$root/.venv"
        local install=("$root/.venv/bin/python" -m pip install -qq --disable-pip-version-check --require-hashes)
        if [ "$kind" = dev ]; then
            "${install[@]}" -r "$root/requirements-dev.lock"
            "${install[@]}" --no-deps -r "$root/requirements-peers.lock"
        elif [ "$kind" = docs ]; then
            "${install[@]}" -r "$root/requirements-docs.lock"
        else
            "${install[@]}" -r "$root/requirements.lock"
        fi
        if [ "$kind" != docs ]; then
            "$root/.venv/bin/python" -m pip install -qq --disable-pip-version-check --no-deps --no-build-isolation -e "$root"
        fi
        echo "$wanted" > "$stamp"
    fi
    # shellcheck disable=SC1091
    . "$root/.venv/bin/activate"
    cd "$root" || return
}
