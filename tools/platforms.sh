# ./run test --platform NAME: tests with the Python and with the libraries of the Ubuntu of a ROS distribution, in a
# virtual environment without access to Debian's Python packages. Sourced by ./run.

declare -A platform_python=([noetic]=3.8 [melodic]=3.6)

platform_packages=(libroslz4-dev libtf2-dev)  # against which two extensions are built

# Python packages of Debian's ROS without compiled code, which run with any Python. The other packages in their folder,
# such as numpy, are of Debian's Python and Debian's versions.
ros_modules=(
  actionlib actionlib_msgs catkin diagnostic_msgs dynamic_reconfigure gencpp genlisp genmsg genpy
  geometry_msgs message_filters move_base_msgs nav_msgs rosbag rosclean roscpp rosgraph rosgraph_msgs roslaunch roslib
  rosmaster rosmsg rosnode rosparam rospy rosservice rostest rostopic rosunit sensor_msgs std_msgs std_srvs tf2_msgs
  tf2_ros visualization_msgs)
debian_python=/usr/lib/python3/dist-packages

use_platform() {  # NAME
  local version=${platform_python[${1:-none}]:-}
  [ -n "$version" ] || fail "test --platform '$1' is unknown; one of bullseye ${!platform_python[*]} expected"
  platform=$1 venv=$cache/$1 workspace=$workspace-$1
  if ! python=$(find_python "$version"); then
    say "no Python $version for $1 on this machine: install one ('pyenv install $version')"
    exit 77  # nothing was tested
  fi
}

find_python() {  # VERSION
  local found
  for found in "python$1" "$(pyenv root 2> /dev/null)/versions/$1".*/bin/python; do
    if [ "$("$found" -c 'import ensurepip, sys; print("%d.%d" % sys.version_info[:2])' 2> /dev/null)" = "$1" ]; then
      echo "$found"
      return
    fi
  done
  return 1
}

set_up_platform() {
  local requirements=$here/tools/platforms/$platform.txt wanted
  wanted=$(cat "$requirements" "$here/tools/platforms.sh" | sha1sum)
  [ "$(cat "$venv/installed" 2> /dev/null)" = "$wanted" ] && return
  say "making a virtual environment of $("$python" --version) for $platform in $venv"
  rm -rf "$venv"
  "$python" -m venv "$venv"
  "$venv/bin/pip" install --quiet --disable-pip-version-check pip==21.3.1  # for old and for new wheels
  "$venv/bin/pip" install --quiet --disable-pip-version-check -r "$requirements"
  mkdir "$venv/ros"
  for module in "${ros_modules[@]}"; do ln -s "$debian_python/$module" "$venv/ros/"; done
  build_extensions > "$venv/extensions.log" 2>&1 || say "no source of tf2 or roslz4 in Debian's archive (log:" \
    "$venv/extensions.log): only tests without them can pass, such as those in test/unit"
  echo "$venv/ros" > "$("$venv/bin/python" -c 'import site; print(site.getsitepackages()[0])')/ros.pth"
  echo "$wanted" > "$venv/installed"
}

build_extensions() (
  sources=$venv/sources
  unpack_source ros-geometry2 && unpack_source ros-ros-comm || return
  build_extension tf2_py _tf2 "$sources"/*/tf2_py/src/tf2_py.cpp -ltf2 -lrostime -lstdc++ || return
  build_extension roslz4 _roslz4 -I"$(echo "$sources"/*/utilities/roslz4/include)" \
    "$sources"/*/utilities/roslz4/src/_roslz4module.c -lroslz4
)

build_extension() {  # PACKAGE MODULE [OPTION OF GCC ...]
  local variable='import sysconfig; print(sysconfig.%s)'
  mkdir -p "$venv/ros/$1"
  ln -s "$debian_python/$1/__init__.py" "$venv/ros/$1/"
  gcc -O1 -w -shared -fPIC -I"$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("include"))')" \
    -o "$venv/ros/$1/$2$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_config_var("EXT_SUFFIX"))')" "${@:3}"
}

# The source of a package in Debian 12, or in a later Debian, if a mirror keeps only that.
unpack_source() {  # PACKAGE
  mkdir -p "$venv"/sources/lists/partial
  cd "$venv/sources"
  printf 'deb-src [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian %s main\n' \
    bookworm unstable > sources.list
  local options=(-o Dir::State::Lists="$PWD/lists" -o Dir::Etc::SourceList="$PWD/sources.list"
    -o Dir::Etc::SourceParts=- -o Dir::Cache="$PWD" -o APT::Sandbox::User=root)
  apt-get "${options[@]}" update
  apt-get "${options[@]}" source --tar-only "$1/bookworm" || apt-get "${options[@]}" source --tar-only "$1" || return
  tar -xf "$1"_*.orig.tar.*
}
