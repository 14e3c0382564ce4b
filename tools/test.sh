# ./run test: all tests, or some of them. Sourced by ./run.

pytest_options=()

run_tests() {
  # Its newest ONNX Runtime and torch lack what some tests need; the report names it.
  ! is_debian_11 || pytest_options=(--leave-out -rs)
  case ${1:-} in
    '') run_all_tests ;;
    -h|--help) help ;;
    --fast)
      [ $# -eq 1 ] || fail "test --fast takes no further arguments, not '$2'"
      setup
      cd "$here"
      "$venv/bin/python3" -m pytest -q -n 2 --dist loadfile -m 'not slow' "${pytest_options[@]}" test/unit ;;
    --long)
      [ $# -eq 1 ] || fail "test --long takes no further arguments, not '$2'"
      pytest_options+=(--long)
      run_some_tests "$here/test/workspace"
      rostest "$here/test/nodes/soak.test" minutes:=2 ;;
    --platform) test_on_platform "${@:2}" ;;
    *) run_some_tests "$@" ;;
  esac
}

run_all_tests() {
  build
  say "running all tests (data: ${ROS_3D_BB_DATA:-made by the tests})"
  rm -rf "$workspace/build/test_results"
  build_planners &  # the tests that need them wait
  catkin_make --directory "$workspace" run_tests -j4
  say "totals"
  local totals status=0
  totals=$(catkin_test_results --all "$workspace/build/test_results") || status=$?
  echo "$totals"
  echo "$totals" | awk '/^Summary:/ { printf "%d passed, %d failed\n", $2 - $4 - $6 - $8, $4 + $6 }'
  return $status
}

test_on_platform() {  # NAME [--fast | -k EXPR | PATH ...]
  local name=${1:-}
  [ $# -eq 0 ] || shift
  if [ "$name" = bullseye ]; then
    set_up_root
    in_root "$here/run" test "$@"
    return
  fi
  use_platform "$name"
  pytest_options=(--leave-out -rs)
  case ${1:-} in
    ''|--fast) run_tests "$@" ;;
    *) run_some_tests "$@" ;;
  esac
}

# Test files and folders by pytest, .test files by rostest; with -k EXPR only, the unit and workspace tests.
run_some_tests() {
  local paths=() expression=() path
  while [ $# -gt 0 ]; do
    case $1 in
      -k) [ $# -gt 1 ] || fail "-k needs an expression"; expression=(-k "$2"); shift ;;
      -*) fail "unknown option '$1' of test; --fast, --long, -k EXPR or paths expected" ;;
      *)
        [ -e "${1%%::*}" ] || fail "there is no '$1' to test"
        paths+=("$(realpath "${1%%::*}")${1#"${1%%::*}"}") ;;
    esac
    shift
  done
  [ ${#paths[@]} -gt 0 ] || paths=("$here/test/unit" "$here/test/workspace")
  if [[ "${paths[*]}" = *"$here/test/gazebo"* ]]; then
    has_gazebo || fail "this machine has no Gazebo 11: ./run test --platform bullseye test/gazebo"
    build_gazebo
  else
    build
  fi
  cd "$here"
  local status=0 by_pytest=()
  for path in "${paths[@]}"; do
    case $path in
      "$here"/test/nodes/*.test)
        [ ${#expression[@]} -eq 0 ] || fail "-k does not apply to '$path', which runs as a whole"
        rostest "$path" || status=$? ;;
      "$here"/test/nodes*) fail "'$path' needs a master: test its .test file" ;;
      "$here"/test/gazebo*) without_screen "$venv/bin/python3" -m pytest -q "$path" "${expression[@]}" || status=$? ;;
      *) by_pytest+=("$path") ;;
    esac
  done
  [ ${#by_pytest[@]} -eq 0 ] || "$venv/bin/python3" -m pytest -q "${pytest_options[@]}" "${by_pytest[@]}" "${expression[@]}" ||
    status=$?
  return $status
}
