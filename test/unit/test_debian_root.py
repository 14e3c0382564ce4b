"""The root file system of Debian 11 that ./run makes, without root's rights: stand-ins take the place of programs."""
import os
import subprocess

import pytest

TOOLS = os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, os.pardir, 'tools')

SHELL = r'''
set -euo pipefail
here=$1 cache=$2
say() { echo "$@"; }
id() { echo 0; }
command() { true; }
apt-config() { true; }
chroot() { true; }
unshare() {
  echo "unshare $*" >> "$cache/calls"
  case "$*" in *debootstrap*) debootstrap_in "$root.part" ;; *) unshare_works ;; esac
}
unshare_works() { true; }
debootstrap_in() { mkdir -p "$1/etc/apt/apt.conf.d"; }
. "$here/tools/bullseye.sh"
'''


@pytest.fixture
def shell(tmp_path):
    def run(commands):
        result = subprocess.run(['bash', '-c', SHELL + commands, '-', os.path.dirname(TOOLS), str(tmp_path)],
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
        return result.returncode, result.stdout
    return run


def debootstraps(folder):
    """How often debootstrap was called."""
    return (folder / 'calls').read_text().count('debootstrap')


def test_a_root_is_made_once(shell, tmp_path):
    assert shell('set_up_root; set_up_root')[0] == 0
    assert debootstraps(tmp_path) == 1 and (tmp_path / 'bullseye' / 'etc').is_dir()


def test_an_interrupted_root_is_made_again(shell, tmp_path):
    status, _ = shell('debootstrap_in() { mkdir -p "$1/etc/half"; exit 130; }; set_up_root')
    assert status == 130 and not (tmp_path / 'bullseye').exists()
    assert shell('set_up_root')[0] == 0
    assert (tmp_path / 'bullseye').is_dir() and not (tmp_path / 'bullseye' / 'etc' / 'half').exists()


def test_a_root_with_other_contents_is_made_again(shell, tmp_path):
    shell('set_up_root')
    assert shell('root_contents=other; set_up_root; set_up_root')[0] == 0
    assert debootstraps(tmp_path) == 2


def test_the_next_mirror_is_asked(shell, tmp_path):
    assert shell('debootstrap_in() { grep -q archive.debian.org "$cache/calls" && mkdir -p "$1/etc/apt/apt.conf.d"; }; '
                 'set_up_root')[0] == 0
    assert debootstraps(tmp_path) == 2


@pytest.mark.parametrize('impossible, named', [
    ('debootstrap_in() { echo "Connection refused"; false; }', 'Connection refused'),
    ('unshare_works() { false; }', 'unshare'),
    ('id() { echo 1000; }; command() { false; }', 'sudo')])
def test_where_it_cannot_be_made_nothing_is_tested(shell, tmp_path, impossible, named):
    status, printed = shell(impossible + '; set_up_root')
    assert status == 77 and named in printed and not (tmp_path / 'bullseye').exists()


def test_the_root_has_the_checkout_and_data_at_the_same_paths(shell, tmp_path, monkeypatch):
    for name in ('PIP_FIND_LINKS', 'DISPLAY'):
        monkeypatch.delenv(name, raising=False)
    data = tmp_path / 'my data'
    data.mkdir()
    monkeypatch.setenv('ROS_3D_BB_DATA', str(data))
    monkeypatch.setenv('PIP_NO_INPUT', 'a b')
    _, printed = shell('unshare() { [ $# -eq 4 ] || printf "%s\\n" "${@:4}"; }; set_up_root() { check_root_rights; }; '
                       'set_up_root; cd "$here/test"; in_root ./run "x y"')
    lines = printed.splitlines()
    separator = lines.index('--')
    assert str(data) in lines[:separator] and lines[-2:] == ['./run', 'x y']
    assert 'ROS_3D_BB_DATA=' + str(data) in lines[separator:] and 'PIP_NO_INPUT=a b' in lines[separator:]
