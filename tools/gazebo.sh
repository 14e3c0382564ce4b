# Builds what Debian 11, which has Gazebo 11, lacks for a Jackal in Gazebo, from the archives in
# $ROS_3D_BB_DATA/gazebo: the ROS plugins of Gazebo, ros_control, robot_localization and the packages of the Jackal.
# Sourced by ./run.

gazebo_packages=(
  gazebo libbondcpp-dev libcamera-info-manager-dev libcv-bridge-dev libdiagnostic-updater-dev libeigen3-dev
  libgazebo-dev libgeographic-dev libimage-transport-dev libnodelet-dev libnodeletlib-dev libpolled-camera-dev
  libtf2-eigen-dev libtf2-geometry-msgs-dev libtf2-ros-dev libtinyxml-dev libtrajectory-msgs-dev liburdf-dev
  libyaml-cpp-dev python3-lxml python3-tf python3-trajectory-msgs ros-actionlib-msgs ros-cmake-modules
  ros-robot-state-publisher ros-trajectory-msgs topic-tools)

gazebo_targets=(
  gazebo_ros_api_plugin gazebo_ros_paths_plugin gazebo_msgs_generate_messages_py gazebo_ros_gencfg
  gazebo_ros_control default_robot_hw_sim gazebo_ros_openni_kinect gazebo_ros_imu gazebo_ros_laser
  controller_manager controller_manager_msgs_generate_messages_py diff_drive_controller joint_state_controller
  ekf_localization_node robot_localization_generate_messages_py)

# Of sensors that the Jackal does not have by default. Its description includes them always.
sensor_descriptions=(
  flir_camera_description/urdf/flir_blackflys lms1xx/urdf/sick_lms1xx
  pointgrey_camera_description/urdf/pointgrey_bumblebee2 pointgrey_camera_description/urdf/pointgrey_flea3
  sick_tim/urdf/sick_tim velodyne_description/urdf/HDL-32E velodyne_description/urdf/VLP-16)

stand_in_sources() {
  local package description
  for package in eigen_conversions flir_camera_description geographic_msgs lms1xx pointgrey_camera_description roslint \
    sick_tim twist_mux velodyne_description xacro; do stand_in_package "$package"; done
  for description in "${sensor_descriptions[@]}"; do
    mkdir -p "${description%/*}"
    echo '<robot/>' > "$description.urdf.xacro"
  done
  mkdir roslint/cmake geographic_msgs/msg
  printf '%s\n' 'macro(roslint_cpp)' 'endmacro()' > roslint/cmake/roslint.cmake
  sed -i 's/catkin_package()/catkin_package(CFG_EXTRAS roslint.cmake)/' roslint/CMakeLists.txt
  printf '%s\n' 'float64 latitude' 'float64 longitude' 'float64 altitude' > geographic_msgs/msg/GeoPoint.msg
  printf '%s\n' 'GeoPoint position' 'geometry_msgs/Quaternion orientation' > geographic_msgs/msg/GeoPose.msg
  printf '%s\n' 'cmake_minimum_required(VERSION 3.0.2)' 'project(geographic_msgs)' \
    'find_package(catkin REQUIRED COMPONENTS geometry_msgs message_generation)' \
    'add_message_files(FILES GeoPoint.msg GeoPose.msg)' 'generate_messages(DEPENDENCIES geometry_msgs)' \
    'catkin_package()' > geographic_msgs/CMakeLists.txt
  # Of ROS 1, whose $(find PACKAGE) searches as rospack does.
  "$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --target xacro/python xacro==1.13.3
  printf '%s\n' '#!/bin/sh' 'here=$(dirname "$0")' \
    'PYTHONPATH=$here/python:$PYTHONPATH exec "$here/python/bin/xacro" "$@"' > xacro/xacro
  chmod +x xacro/xacro
  # With cmd_vel as the only source of velocities, the multiplexer is a relay.
  printf '%s\n' '#!/bin/sh' 'exec /usr/lib/topic_tools/relay cmd_vel cmd_vel_out "$@"' > twist_mux/twist_mux
  chmod +x twist_mux/twist_mux
}

make_gazebo() {  # FOLDER
  mkdir "$1/src"
  cd "$1/src"
  for archive in "${gazebo_sources[@]}"; do tar -xf "$archive"; done
  stand_in_sources
  rm -rf gazebo_ros_pkgs/gazebo_ros_pkgs jackal_simulator/jackal_simulator realsense_gazebo_plugin ros_control/ros_control \
    ros_control/{combined_robot_hw,combined_robot_hw_tests,controller_manager_tests,rqt_controller_manager} \
    ros_controllers/{forward_command_controller,ros_controllers,velocity_controllers}
  sed -i 's/ros::Time::MIN/ros::Time(0, 1)/' ros_controllers/*/src/*.cpp  # the same value; Debian 11 lacks the name
  sed -i '/^ *roslaunch_add_file_check/d' jackal*/jackal_*/CMakeLists.txt  # a test, which is not built
  unset CMAKE_PREFIX_PATH PYTHONPATH ROS_PACKAGE_PATH  # they must not depend on the workspace of this checkout
  export ROS_LANG_DISABLE='genlisp:gennodejs:geneus'
  catkin_make --directory "$1" -DPYTHON_EXECUTABLE="$venv/bin/python3" -DCATKIN_ENABLE_TESTING=OFF \
    -DCMAKE_CXX_FLAGS='-O1 -w' -j2 "${gazebo_targets[@]}" || return
  # Takes the same parameters as the plugin of hector_gazebo_plugins that the description names.
  ln -s libgazebo_ros_imu.so "$1/devel/lib/libhector_gazebo_ros_imu.so"
}

# Debian 12 has no Gazebo 11.
has_gazebo() { [ -d /opt/ros ] || is_debian_11; }

# Builds what is needed for gazebo.launch, and sets up its environment.
build_gazebo() {
  local archives=''
  if [ -d "${ROS_3D_BB_DATA:-}/gazebo" ] && [ ! -d /opt/ros ]; then
    archives=yes
    apt_packages+=("${gazebo_packages[@]}")
  fi
  build
  set +u
  [ -z "$archives" ] || { build_gazebo_archives && . "$gazebo/devel/setup.bash" --extend; }
  build_planners
  [ -z "${planners:-}" ] || . "$planners/devel/setup.bash" --extend
  set -u
  rospack find jackal_gazebo > /dev/null 2>&1 || fail "jackal_gazebo is not installed: on ROS Noetic, install \
ros-noetic-jackal-simulator; on Debian, set ROS_3D_BB_DATA to a folder with the archives in gazebo/ (doc/simulation.md)"
}

build_gazebo_archives() {
  gazebo_sources=("$ROS_3D_BB_DATA"/gazebo/*.tar.xz)
  local hash
  hash=$({ cat "${gazebo_sources[@]}"; declare -f make_gazebo stand_in_sources; declare -p gazebo_targets; } | sha1sum)
  gazebo=$cache/gazebo-${hash:0:8}
  build_once 'packages for Gazebo' "$gazebo" make_gazebo
}

# A screen that is not shown, which cameras of Gazebo need as well.
without_screen() { xvfb-run -a -s '-screen 0 640x480x24' "$@"; }

gazebo() {  # [NAME:=VALUE ...]
  if ! has_gazebo; then
    set_up_root
    in_root "$here/run" gazebo "$@"
    return
  fi
  build_gazebo
  choose_master
  local command=(roslaunch -p "${ROS_MASTER_URI##*:}" ros_3d_bb gazebo.launch detector:=depth)
  if [ -n "${DISPLAY:-}" ]; then
    "${command[@]}" "$@"
  else
    say "no screen (DISPLAY is not set): without the windows of Gazebo and RViz"
    without_screen "${command[@]}" gui:=false rviz:=false "$@"
  fi
}
