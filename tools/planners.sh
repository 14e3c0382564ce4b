# Builds the planners that tests and benchmarks run, from the archives in $ROS_3D_BB_DATA/planners: costmap_2d,
# social_navigation_layers, and move_base with navfn, DWA and TEB. Sourced by ./run; without archives it does nothing.

planner_packages=(
  libactionlib-dev libangles-dev libboost-graph-dev libclass-loader-dev libinteractive-markers-dev
  liblaser-geometry-dev libmap-msgs-dev libmessage-filters-dev libmove-base-msgs-dev libnav-msgs-dev libstd-srvs-dev
  libsuitesparse-dev libtf-dev libtf2-eigen-dev libtf2-sensor-msgs-dev libtinyxml2-dev libvisualization-msgs-dev
  pluginlib-dev python3-actionlib ros-map-msgs ros-nav-msgs)

# A stand-in for a package that Debian lacks, in the current folder.
stand_in_package() {  # NAME
  mkdir "$1"
  echo "<package format=\"2\"><name>$1</name><version>0.0.0</version><description>empty</description>
    <maintainer email=\"nobody@example.com\">nobody</maintainer><license>BSD</license>
    <buildtool_depend>catkin</buildtool_depend></package>" > "$1/package.xml"
  printf '%s\n' 'cmake_minimum_required(VERSION 3.0.2)' "project($1)" 'find_package(catkin REQUIRED)' \
    'catkin_package()' > "$1/CMakeLists.txt"
}

# What teb_local_planner needs of move_base_flex when move_base runs it: a base class and numbers of results.
stand_in_move_base_flex() {
  stand_in_package mbf_costmap_core
  mkdir -p mbf_costmap_core/include/{mbf_costmap_core,mbf_msgs}
  sed -i 's/catkin_package()/catkin_package(INCLUDE_DIRS include)/' mbf_costmap_core/CMakeLists.txt
  cat > mbf_costmap_core/include/mbf_costmap_core/costmap_controller.h << 'END'
#pragma once
#include <boost/shared_ptr.hpp>
namespace mbf_costmap_core {
struct CostmapController {
  typedef boost::shared_ptr<CostmapController> Ptr;
  virtual ~CostmapController() {}
};
}
END
  cat > mbf_costmap_core/include/mbf_msgs/ExePathResult.h << 'END'
#pragma once
namespace mbf_msgs {
struct ExePathResult {
  enum { SUCCESS = 0, NO_VALID_CMD = 102, INVALID_PATH = 103, NOT_INITIALIZED = 112, INTERNAL_ERROR = 114 };
};
}
END
}

# Changes teb_local_planner for this g2o, this dynamic_reconfigure, and for stand_in_move_base_flex.
patch_teb() {  # FOLDER of g2o
  local libraries=""
  for library in core stuff solver_csparse csparse_extension solver_cholmod; do
    libraries="$libraries $1/lib/libg2o_$library.so"
  done
  sed -i -e '/^ *mbf_msgs$/d' -e 's/-std=c++11/-std=c++17/' -e '/find_package(SUITESPARSE/d' \
    -e '/DEPENDS SUITESPARSE/d' -e "s|find_package(G2O.*|set(G2O_LIBRARIES$libraries)|" \
    -e "s|set(EXTERNAL_INCLUDE_DIRS .*|set(EXTERNAL_INCLUDE_DIRS $1 /usr/include/eigen3 /usr/include/suitesparse)|" \
    teb_local_planner/CMakeLists.txt
  sed -i -e '/<depend>mbf_msgs/d' -e '/<depend>libg2o/d' teb_local_planner/package.xml
  sed -i -E 's/new (g2o::HyperGraphElementCreator<\w+>)\)/std::make_shared<\1>())/' \
    teb_local_planner/src/optimal_planner.cpp
  sed -i -e 's/class_list_macros.h>/class_list_macros.hpp>/' \
    -e '/reconfigureCB, this/s/boost::bind\(.*\)_1, _2/std::bind\1std::placeholders::_1, std::placeholders::_2/' \
    teb_local_planner/src/teb_local_planner_ros.cpp
}

make_g2o() {  # FOLDER, which contains the source
  cd "$1"
  cmake . -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_FLAGS='-O1 -w' -DCMAKE_UNITY_BUILD=ON -DG2O_BUILD_EXAMPLES=OFF \
    -DG2O_BUILD_APPS=OFF -DG2O_USE_OPENGL=OFF -DG2O_USE_LOGGING=OFF -DG2O_BUILD_SLAM2D_TYPES=OFF \
    -DG2O_BUILD_SLAM3D_TYPES=OFF
  make -j2 core stuff solver_csparse solver_cholmod
}

# A unity build of the needed targets takes 5 instead of 20 minutes of CPU time.
make_planners() {  # FOLDER
  mkdir "$1/src"
  cd "$1/src"
  for archive in "${planner_sources[@]}"; do tar -xf "$archive"; done
  patch -s -p1 < "$archives/patches.diff"
  stand_in_package cmake_modules
  stand_in_move_base_flex
  touch vision_msgs/CATKIN_IGNORE
  mv g2o "$1/g2o"
  patch_teb "$1/g2o"
  (make_g2o "$1/g2o")
  unset CMAKE_PREFIX_PATH PYTHONPATH ROS_PACKAGE_PATH  # they must not depend on the workspace of this checkout
  export ROS_LANG_DISABLE=genlisp
  catkin_make --directory "$1" -DPYTHON_EXECUTABLE="$venv/bin/python3" -DCATKIN_ENABLE_TESTING=OFF \
    -DCMAKE_CXX_FLAGS='-O1 -w' -DCMAKE_UNITY_BUILD=ON -DCMAKE_UNITY_BUILD_BATCH_SIZE=0 -j2 \
    costmap_2d_node layers social_layers people_msgs_generate_messages_py costmap_converter_generate_messages_py \
    move_base_node navfn dwa_local_planner teb_local_planner
}

build_planners() {
  archives=${ROS_3D_BB_DATA:-}/planners
  [ -d "$archives" ] || return 0
  # NAME_COMMIT; other archives may lie beside them.
  planner_sources=("$archives"/{navigation,navigation_layers,people,costmap_converter,vision_msgs,g2o}_[0-9a-f]*.tar.xz
    "$archives"/teb_local_planner.tar.xz)
  local hash
  hash=$(cat "${planner_sources[@]}" "$archives/patches.diff" "$here/tools/planners.sh" | sha1sum | cut -c1-8)
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
    rm -rf "$2"/{src,build,devel,g2o}
    if "$3" "$2" > "$2/build.log" 2>&1; then touch "$2/built"
    else tail -n 50 "$2/build.log"; say "the $1 were not built; their log is above"; exit 1; fi
  ) 9> "$2/lock" >&2
}
