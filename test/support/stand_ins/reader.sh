# Commands that a test machine does not have or must not run: they are logged in $READER_LOG.
# Functions have precedence over PATH, also in scripts that change PATH.
log() { printf '%s\n' "$*" >> "$READER_LOG"; }
sudo() { "$@"; }
apt() { log apt "$@"; }
rosdep() { log rosdep "$@"; }
git() { log git "$@"; ln -sfn "$READER_CLONE" "${@: -1}"; }
dpkg-query() { echo 'install ok installed'; }
# The workspace that runs the tests has built the package already; the next one would take a minute more.
catkin_make() {
  log catkin_make "$@"
  local at=$PWD; [ "${1:-}" != --directory ] || at=$2
  mkdir -p "$at/devel" "$at/build/test_results"
  echo "export ROS_PACKAGE_PATH=\$ROS_PACKAGE_PATH:$at/src" > "$at/devel/setup.bash"
}
export -f log sudo apt rosdep git dpkg-query catkin_make
