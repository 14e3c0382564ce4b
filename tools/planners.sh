# Builds the planners that tests and benchmarks run, from the archives in $ROS_3D_BB_DATA/planners: costmap_2d,
# social_navigation_layers, and move_base with navfn and DWA. Sourced by ./run; without archives it does nothing.

planner_packages=(
  libactionlib-dev libangles-dev libclass-loader-dev liblaser-geometry-dev libmap-msgs-dev libmessage-filters-dev
  libmove-base-msgs-dev libnav-msgs-dev libstd-srvs-dev libtf-dev libtf2-sensor-msgs-dev libtinyxml2-dev
  libvisualization-msgs-dev pluginlib-dev python3-actionlib ros-map-msgs ros-nav-msgs)

# A stand-in for a package that Debian lacks, in the current folder.
stand_in_package() {  # NAME
  mkdir "$1"
  echo "<package format=\"2\"><name>$1</name><version>0.0.0</version><description>empty</description>
    <maintainer email=\"nobody@example.com\">nobody</maintainer><license>BSD</license>
    <buildtool_depend>catkin</buildtool_depend></package>" > "$1/package.xml"
  printf '%s\n' 'cmake_minimum_required(VERSION 3.0.2)' "project($1)" 'find_package(catkin REQUIRED)' \
    'catkin_package()' > "$1/CMakeLists.txt"
}

# A unity build of the needed targets takes 2.5 instead of 16 minutes of CPU time.
make_planners() {  # FOLDER
  mkdir "$1/src"
  cd "$1/src"
  for archive in "${planner_sources[@]}"; do tar -xf "$archive"; done
  patch -s -p1 < "$archives/patches.diff"
  stand_in_package cmake_modules
  touch costmap_converter/CATKIN_IGNORE vision_msgs/CATKIN_IGNORE
  unset CMAKE_PREFIX_PATH PYTHONPATH ROS_PACKAGE_PATH  # they must not depend on the workspace of this checkout
  export ROS_LANG_DISABLE=genlisp
  catkin_make --directory "$1" -DPYTHON_EXECUTABLE="$venv/bin/python3" -DCATKIN_ENABLE_TESTING=OFF \
    -DCMAKE_CXX_FLAGS='-O1 -w' -DCMAKE_UNITY_BUILD=ON -DCMAKE_UNITY_BUILD_BATCH_SIZE=0 -j2 \
    costmap_2d_node layers social_layers people_msgs_generate_messages_py move_base_node navfn dwa_local_planner
}

build_planners() {
  archives=${ROS_3D_BB_DATA:-}/planners
  [ -d "$archives" ] || return 0
  # NAME_COMMIT; other archives may lie beside them.
  planner_sources=("$archives"/{navigation,navigation_layers,people,costmap_converter,vision_msgs}_[0-9a-f]*.tar.xz)
  local hash; hash=$(cat "${planner_sources[@]}" "$archives/patches.diff" | sha1sum | cut -c1-8)
  planners=$cache/planners-$hash
  build_once planners "$planners" make_planners
}

# Builds sources in a folder, unless they were built there before.
build_once() {  # NAME FOLDER FUNCTION
  mkdir -p "$2"
  (
    flock 9
    [ -f "$2/built" ] && exit
    say "building $1 in $2, once"
    rm -rf "$2"/{src,build,devel}
    if "$3" "$2" > "$2/build.log" 2>&1; then touch "$2/built"
    else tail -n 50 "$2/build.log"; say "the $1 were not built; their log is above"; exit 1; fi
  ) 9> "$2/lock" >&2
}
