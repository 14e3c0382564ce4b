"""`./run test FILE.test`: a failed test makes it fail. `rostest --text` returns 0 whatever the tests in it did."""
import os
import subprocess

import pytest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))

# run_some_tests in a package of its own, without a build
SHELL = '''
set -euo pipefail
here=$1 apt_packages=()
build() { :; }
fail() { echo "$@"; exit 2; }
. "$2/tools/test.sh"
run_some_tests "$here/test/nodes/one.test"
'''


@pytest.mark.slow
@pytest.mark.parametrize('test, status', [('assert True', 0), ('assert False', 2)])
def test_a_failed_rostest_is_reported(tmp_path, test, status):
    nodes = tmp_path / 'test' / 'nodes'
    nodes.mkdir(parents=True)
    (tmp_path / 'package.xml').write_text(
        '<package format="2"><name>one_test</name><version>0.0.0</version><description>none</description>'
        '<maintainer email="a@example.com">a</maintainer><license>BSD</license></package>')
    (nodes / 'test_one.py').write_text('def test_one():\n    %s\n' % test)
    (nodes / 'one.test').write_text('<launch><test pkg="ros_3d_bb" type="pytest_in_ros" test-name="test_one" '
                                    'args="%s"/></launch>' % (nodes / 'test_one.py'))
    environment = dict(os.environ, ROS_PACKAGE_PATH='%s:%s' % (tmp_path, os.environ.get('ROS_PACKAGE_PATH', '')),
                       ROS_TEST_RESULTS_DIR=str(tmp_path / 'results'), ROS_LOG_DIR=str(tmp_path / 'log'))
    result = subprocess.run(['bash', '-c', SHELL, '-', str(tmp_path), ROOT], env=environment, stdout=subprocess.PIPE,
                            stderr=subprocess.STDOUT, universal_newlines=True)
    assert result.returncode == status and '* TESTS: 1' in result.stdout, result.stdout
