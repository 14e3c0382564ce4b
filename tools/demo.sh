# ./run demo: a simulated robot among walking people. Sourced by ./run.

demo() {
  local scenario=demo weights='' rate=0
  [ -f "$weights_default" ] && weights=$weights_default
  for argument in "$@"; do
    case $argument in
      weights:=*)
        weights=$(realpath -e "${argument#weights:=}" 2> /dev/null) \
          || fail "demo: there is no file '${argument#weights:=}'" ;;
      rate:=*)
        rate=${argument#rate:=}
        [[ $rate =~ ^[0-9]+(\.[0-9]*)?$ ]] || fail "demo: rate is '$rate'; a number expected" ;;
      -h|--help) help; exit ;;
      -*|*:=*) fail "demo: unknown option '$argument'; weights:=FILE, rate:=HZ or a scenario expected" ;;
      *) scenario=$argument ;;
    esac
  done
  local file=$here/config/scenarios/${scenario%.yaml}.yaml
  [ -f "$file" ] || file=$(realpath -e "$scenario" 2> /dev/null) || fail "there is no scenario '$scenario'"
  local options=("scenario:=$file" "rate:=$rate")
  if [ -n "$weights" ]; then
    options+=(detector:=yolov5 "weights:=$weights")
  fi
  build
  options+=("cameras:=$(PYTHONPATH=$here/src "$venv/bin/python3" -c '
import sys
from ros_3d_bb_lab.simulation.scenario import read_scenario
print(",".join(mount.name for mount in read_scenario(sys.argv[1]).robot.cameras))' "$file")")
  mkdir -p "$workspace/demo"
  exec 9> "$workspace/demo/lock"
  flock -n 9 || { say "a demo of this checkout runs already"; exit 1; }
  choose_master
  say "scene: $(basename "$file" .yaml); people are found by ${weights:-depth and HOG (no weights given)}"
  if [ -n "${DISPLAY:-}" ]; then
    say "the scene, with RViz, again and again; Ctrl-C ends it"
    exec roslaunch -p "${ROS_MASTER_URI##*:}" ros_3d_bb simulation.launch wait_for_subscribers:=1 "${options[@]}"
  fi
  say "no screen (DISPLAY is not set): the scene once, and a report of it"
  demo_without_screen "${options[@]}"
}

demo_without_screen() {
  local folder=$workspace/demo status=0
  rm -f "$folder"/scene.* "$folder/launch.log"
  # In the background, as a shell that waits for what it runs in the foreground hears no signal.
  roslaunch -p "${ROS_MASTER_URI##*:}" ros_3d_bb simulation.launch rviz:=false repeat:=false \
    "record:=$folder/scene.bag" "$@" > "$folder/launch.log" 2>&1 &
  local launch=$!
  trap "kill -INT $launch 2> /dev/null; wait $launch; echo; say 'stopped'; exit 130" INT TERM
  while kill -0 $launch 2> /dev/null; do
    sleep 0.5
    show_progress "$folder/launch.log"
    # roslaunch goes on when a node dies, and ends well whatever its nodes did
    ! grep -qE 'FATAL|Traceback' "$folder/launch.log" || kill -INT $launch 2> /dev/null || true
  done
  wait $launch || true
  trap - INT TERM
  echo
  if [ ! -f "$folder/scene.bag" ] || grep -qE 'FATAL|Traceback' "$folder/launch.log"; then
    cat "$folder/launch.log"
    say "the demo failed; its log is above. $(grep -hE -m 1 'FATAL' "$folder/launch.log" || true)"
    exit 1
  fi
  say "what became of it"
  rosrun ros_3d_bb scene_report "$folder/scene.bag"
  echo "bag: $folder/scene.bag ($(du -h "$folder/scene.bag" | cut -f 1)), log: $folder/launch.log"
}

# A bar that shows the last "image N of M" of the simulator in a log.
show_progress() {
  local count total bar
  read -r count total < <(grep -oE 'image [0-9]+ of [0-9]+' "$1" | tail -n 1 | tr -dc '0-9 \n') || return 0
  bar=$(printf '%*s' $((40 * count / total)) '')
  printf '\r[%-40s] %3d %%' "${bar// /#}" $((100 * count / total))
}

# A robot's master that runs already must not get the demo's /use_sim_time and /clock.
choose_master() {
  (exec 3<> /dev/tcp/localhost/11311) 2> /dev/null || { export ROS_MASTER_URI=http://localhost:11311; return; }
  ROS_MASTER_URI=http://localhost:$(python3 -c 'import socket; s = socket.socket(); s.bind(("", 0)); print(s.getsockname()[1])')
  export ROS_MASTER_URI
  say "a ROS master runs already; the demo has its own: export ROS_MASTER_URI=$ROS_MASTER_URI"
}
