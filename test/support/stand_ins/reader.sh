# What a reader types and a test machine has not, or must not do: written down in $READER_LOG, and answered.
# Functions, as they go before whatever PATH has, also in scripts that set PATH anew.
said() { printf '%s\n' "$*" >> "$READER_LOG"; }
sudo() { "$@"; }
apt() { said apt "$@"; }
pip3() { said pip3 "$@"; }
rosdep() { said rosdep "$@"; }
systemctl() { said systemctl "$@"; }
wget() { said wget "$@"; ln -sf "$READER_WEIGHTS" .; }
git() { said git "$@"; ln -sfn "$READER_CLONE" "${@: -1}"; }
dpkg-query() { echo 'install ok installed'; }
# The workspace that runs the tests has built the package already; the next one would take a minute more.
catkin_make() {
  said catkin_make "$@"
  local at=$PWD; [ "${1:-}" != --directory ] || at=$2
  mkdir -p "$at/devel" "$at/build/test_results"
  echo "export ROS_PACKAGE_PATH=\$ROS_PACKAGE_PATH:$at/src" > "$at/devel/setup.bash"
}
export -f said sudo apt pip3 rosdep systemctl wget git dpkg-query catkin_make
