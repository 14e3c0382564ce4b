# A root file system of Debian 11, which has ROS of Noetic's versions and Gazebo 11: set_up_root makes it once, in_root
# runs a command in it. Sourced by ./run, which defines here and cache.

root=$cache/bullseye
root_contents='bullseye minbase ca-certificates 1'  # another number: the roots that exist are made anew
debian_mirrors=(http://deb.debian.org/debian http://archive.debian.org/debian)

untestable() { say "no Debian 11 on this machine: $*" >&2; exit 77; }  # nothing was tested

# Root's rights and a mount namespace are what debootstrap and chroot need; some containers have neither.
check_root_rights() {
  root_sudo=()
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo > /dev/null || untestable "it needs root's rights; you are not root, and there is no sudo"
    root_sudo=(sudo)
  fi
  "${root_sudo[@]}" unshare --mount --propagation private true 2> /dev/null \
    || untestable "'unshare --mount' is refused here; a container needs --cap-add SYS_ADMIN and, on systems with" \
      "AppArmor, --security-opt apparmor=unconfined"
}

set_up_debootstrap() {
  if command -v debootstrap > /dev/null && [ -f /usr/share/keyrings/debian-archive-keyring.gpg ]; then return; fi
  command -v apt-get > /dev/null || untestable "debootstrap is not installed, and there is no apt-get to install it"
  say "installing debootstrap"
  "${root_sudo[@]}" apt-get update -q > /dev/null
  "${root_sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends debootstrap \
    debian-archive-keyring > /dev/null || untestable "apt-get could not install debootstrap"
}

set_up_root() {
  PATH=$PATH:/usr/sbin:/sbin
  check_root_rights
  [ "$(cat "$root/etc/made_by_ros_3d_bb" 2> /dev/null)" = "$root_contents" ] && return
  set_up_debootstrap
  mkdir -p "$cache"
  exec 8> "$cache/bullseye.lock"
  flock 8
  [ "$(cat "$root/etc/made_by_ros_3d_bb" 2> /dev/null)" = "$root_contents" ] || make_root
  exec 8>&-
}

# An interrupted one keeps its temporary name.
make_root() {
  say "making a root file system of Debian 11 in $root, once (log: $cache/bullseye.log)"
  local mirror
  for mirror in "${debian_mirrors[@]}"; do
    "${root_sudo[@]}" rm -rf --one-file-system "$root.part"
    "${root_sudo[@]}" unshare --mount --propagation private env $(proxy_settings) debootstrap --variant=minbase \
      --include=ca-certificates bullseye "$root.part" "$mirror" > "$cache/bullseye.log" 2>&1 8>&- || continue
    # A mirror that is not reached is an error; packages are not kept after their installation.
    printf '%s\n' 'APT::Update::Error-Mode "any";' 'APT::Keep-Downloaded-Packages "false";' |
      "${root_sudo[@]}" tee "$root.part/etc/apt/apt.conf.d/90ros_3d_bb" > /dev/null
    echo "$root_contents" | "${root_sudo[@]}" tee "$root.part/etc/made_by_ros_3d_bb" > /dev/null
    "${root_sudo[@]}" rm -rf --one-file-system "$root"
    "${root_sudo[@]}" mv "$root.part" "$root"
    return
  done
  tail -n 3 "$cache/bullseye.log" >&2
  untestable "debootstrap could not make it from ${debian_mirrors[*]}; the end of its log is above"
}

# NAME=VALUE of the proxy of the environment, or of apt.
proxy_settings() {
  local http_proxy=${http_proxy:-} name
  [ -n "$http_proxy" ] || ! command -v apt-config > /dev/null || eval "$(apt-config shell http_proxy Acquire::http::Proxy)"
  for name in http_proxy https_proxy no_proxy; do [ -z "${!name:-}" ] || echo "$name=${!name}"; done
}

# Runs a command in the root, as root, in the same folder of the checkout, which has the same path there, as has
# ROS_3D_BB_DATA; both are read-only. What ./run installs and builds there, it keeps in the root.
in_root() {  # COMMAND [ARGUMENT ...]
  local folder=$PWD data='' name paths=("$here" /etc/resolv.conf /etc/hosts) settings
  [[ $PWD/ = "$here"/* ]] || folder=$here
  settings=(HOME=/root PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8
    "TERM=${TERM:-dumb}" $(proxy_settings))
  if [ -n "${ROS_3D_BB_DATA:-}" ]; then
    data=$(realpath -e "$ROS_3D_BB_DATA") || fail "ROS_3D_BB_DATA: there is no folder '$ROS_3D_BB_DATA'"
    paths+=("$data")
    settings+=("ROS_3D_BB_DATA=$data")
  fi
  for name in ${!PIP_@} ${!OPENBLAS_@}; do settings+=("$name=${!name}"); done
  paths+=("${PIP_CERT:-}" "${PIP_FIND_LINKS:-}")
  if [ -n "${DISPLAY:-}" ]; then
    name=${DISPLAY##*:}
    local cookie=${XAUTHORITY:-$HOME/.Xauthority}
    paths+=("/tmp/.X11-unix/X${name%.*}" "$cookie")
    settings+=("DISPLAY=$DISPLAY" "XAUTHORITY=$cookie")
  fi
  "${root_sudo[@]}" unshare --mount --propagation private bash -c "$(declare -f enter_root); enter_root \"\$@\"" - \
    "$root" "$folder" "${paths[@]}" -- "${settings[@]}" "$@"
}

# In a mount namespace of its own, with which the mounts end.
enter_root() {  # ROOT FOLDER [PATH ...] -- [NAME=VALUE ...] COMMAND [ARGUMENT ...]
  set -e
  local root=$1 folder=$2
  shift 2
  mount -t proc proc "$root/proc"
  mount --rbind /dev "$root/dev"
  mount --rbind /sys "$root/sys"
  while [ "$1" != -- ]; do
    if [ -d "$1" ]; then
      mkdir -p "$root$1"
    elif [ -e "$1" ]; then
      mkdir -p "$(dirname "$root$1")"
      touch "$root$1"
    fi
    [ ! -e "$1" ] || { mount --bind "$1" "$root$1"; mount -o remount,bind,ro "$root$1"; }
    shift
  done
  shift
  exec chroot "$root" env --chdir="$folder" -i "$@"
}
