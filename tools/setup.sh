# Sets up what ./run needs: Debian packages, a virtual environment and a catkin workspace outside the checkout.
# Sourced by ./run, which defines here, cache, venv and workspace.

apt_packages=(
  build-essential catkin catkin-lint cmake libdynamic-reconfigure-config-init-mutex-dev libgeometry-msgs-dev
  libgl1-mesa-dri libroscpp-dev librostest-dev libsensor-msgs-dev libstd-msgs-dev python3-actionlib-msgs
  python3-diagnostic-msgs python3-dynamic-reconfigure python3-genpy python3-geometry-msgs python3-matplotlib
  python3-nav-msgs python3-numpy python3-opencv python3-pyqt5 python3-rosbag python3-rosgraph python3-rosgraph-msgs
  python3-roslib python3-rospkg python3-rospy python3-rostest python3-scipy python3-sensor-msgs python3-setuptools
  python3-std-msgs python3-std-srvs python3-tf2-msgs python3-tf2-ros python3-venv python3-visualization-msgs
  python3-yaml ros-core ros-geometry-msgs ros-message-generation ros-message-runtime ros-sensor-msgs ros-std-msgs
  rosbash rviz tf2-tools xauth xdotool xvfb)

is_debian_11() { grep -qs VERSION_CODENAME=bullseye /etc/os-release; }

set_up_system() {
  command -v apt-get > /dev/null || { say "no apt-get here; taking it that ROS is installed"; return; }
  if [ -d /opt/ros ]; then
    say "ROS is in /opt/ros; its packages are not touched"
    set +u; . "$(ls -d /opt/ros/*/setup.bash | tail -n 1)"; set -u
    return
  fi
  local missing=()
  ! is_debian_11 || apt_packages+=(python3-torch)  # PyPI has only one with CUDA
  [ ! -d "${ROS_3D_BB_DATA:-}/planners" ] || apt_packages+=("${planner_packages[@]}")
  for package in "${apt_packages[@]}"; do
    dpkg-query -W -f '${Status}' "$package" 2> /dev/null | grep -q 'ok installed' || missing+=("$package")
  done
  [ ${#missing[@]} -eq 0 ] && return
  local sudo=; [ "$(id -u)" -eq 0 ] || sudo=sudo
  say "installing ${#missing[@]} Debian packages: ${missing[*]}"
  $sudo apt-get update -q || { say "the package archive cannot be reached, and packages are missing"; exit 77; }
  $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends "${missing[@]}"
  [ ! -f /etc/made_by_ros_3d_bb ] || mend_root
}

# ROS of Debian 11 calls Thread.isAlive, which the Python 3.9 of Debian 11 does not have: without it, nodes and roslaunch
# end with an error. Only in a root file system of ./run.
mend_root() {
  { grep -rlZ '\.isAlive()' "$debian_python"/ros* || true; } | xargs -0r sed -i 's/\.isAlive()/.is_alive()/'
}

set_up_python() {
  local wanted; wanted=$(cat "$here"/test/requirements*.txt | sha1sum)
  [ "$(cat "$venv/installed" 2> /dev/null)" = "$wanted" ] && return
  say "making a virtual environment in $venv"
  python3 -m venv --system-site-packages "$venv"
  "$venv/bin/pip" install --quiet --disable-pip-version-check -r "$here/test/requirements.txt"
  "$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps -r "$here/test/requirements_no_deps.txt"
  echo "$wanted" > "$venv/installed"
}

setup() {
  if [ -n "${platform:-}" ]; then
    apt_packages+=("${platform_packages[@]}")
    set_up_system
    set_up_platform
  else
    set_up_system
    set_up_python
  fi
}

link_into_workspace() {
  mkdir -p "$workspace/src"
  ln -sfn "$here" "$workspace/src/ros_3d_bb"
}

# The path in the documentation leads to the workspace of the checkout that was built last.
link_common_path() {
  local last; last=$(readlink "$cache/workspace" || true)
  [ "${last:-$workspace}" = "$workspace" ] || say "$cache/workspace was $last, and is now $workspace, of this checkout"
  ln -sfn "$workspace" "$cache/workspace"
}

build() {
  setup
  say "building in $workspace"
  link_into_workspace
  catkin_make --directory "$workspace" -DPYTHON_EXECUTABLE="$venv/bin/python3" \
    -Dros_3d_bb_LEAVE_OUT_TESTS="$({ [ -n "${platform:-}" ] || is_debian_11; } && echo ON || echo OFF)" \
    -Dros_3d_bb_TEST_PLANNERS="$([ -z "${platform:-}" ] && [ -d "${ROS_3D_BB_DATA:-}/planners" ] && echo ON || echo OFF)" \
    > "$workspace/build.log" 2>&1 || {
    cat "$workspace/build.log"; say "the build failed; its log is above"; exit 1; }
  [ -n "${platform:-}" ] || link_common_path
  set +u; . "$workspace/devel/setup.bash"; set -u
  if [ -n "${platform:-}" ]; then
    export PATH=$venv/bin:$PATH  # for scripts that begin with env python3
    export ROS_PACKAGE_PATH=$ROS_PACKAGE_PATH:/usr/share  # Debian's rospkg searches it by default
  fi
  export ROS_LOG_DIR=${ROS_LOG_DIR:-$workspace/log}
}
