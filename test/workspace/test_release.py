"""Input of the release tools: package.xml, the changelog, and the Debian package of each key."""
import os

from catkin_pkg.changelog import Changelog, populate_changelog_from_rst
from catkin_pkg.package import parse_package
from catkin_pkg.package_version import get_forthcoming_label, rename_section

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
KINDS = ('buildtool_depends', 'build_depends', 'build_export_depends', 'exec_depends', 'test_depends')
# Python of each release, as for rosdep, bloom and catkin; Debian's own ROS has no name before it is sourced.
RELEASES = {'melodic': '2', 'noetic': '3', '': '3'}
# rosdep keys and their packages on Ubuntu, (bionic, focal). Sources: python.yaml and base.yaml of ros/rosdistro,
# commits 662921b and 8f8e55c.
# ROS packages, whose Ubuntu package is ros-DISTRO-NAME: all are part or dependencies of desktop in REP 150 (Melodic and
# Noetic).


def package_for(distro):
    """package.xml with its conditions evaluated for a release of ROS."""
    warnings = []
    package = parse_package(os.path.join(ROOT, 'package.xml'), warnings=warnings)
    package.validate(warnings=warnings)
    assert warnings == []
    package.evaluate_conditions({'ROS_VERSION': '1', 'ROS_DISTRO': distro, 'ROS_PYTHON_VERSION': RELEASES[distro]})
    return package


def keys_of(package, kinds=KINDS):
    """Names of the dependencies whose conditions hold."""
    return set(depend.name for kind in kinds for depend in getattr(package, kind) if depend.evaluated_condition)


def released(text):
    """{version: lines} of a changelog, as catkin_prepare_release and bloom read it."""
    changelog = populate_changelog_from_rst(Changelog('ros_3d_bb'), text)
    return {version: [str(bullet) for part in content for bullet in part]
            for version, _date, content in changelog.foreach_version()}


def test_the_changelog_can_be_read_and_has_the_version():
    """Forthcoming lines become a version, as in catkin_prepare_release; the newest one is that of package.xml."""
    with open(os.path.join(ROOT, 'CHANGELOG.rst')) as stream:
        text = stream.read()
    version = package_for('noetic').version
    assert version == max(released(text), key=lambda name: [int(part) for part in name.split('.')])
    label = get_forthcoming_label(text)
    if label:
        version, text = '99.0.0', rename_section(text, label, '99.0.0 (2030-01-01)')
    written = text.split('\n%s (' % version)[1].split('\n\n')[0].split('\n* ')[1:]
    assert [line.split() for line in released(text)[version]] == [line.split() for line in written]


def test_dependencies_of_each_release():
    keys = {distro: keys_of(package_for(distro)) for distro in RELEASES}
    assert not any(key.endswith('-pip') for names in keys.values() for key in names)  # bloom resolves keys of apt only
    assert 'python3-torch' not in keys['melodic']  # only Debian has it
    assert keys[''] - keys['noetic'] == {'python3-torch', 'tf2_tools'}
    # of the Python 2 of Melodic
    assert keys['melodic'] - keys['noetic'] == {'python3-empy', 'python3-gnupg', 'python3-pycryptodome'}
    assert 'python3-catkin-pkg-modules' in keys_of(package_for('melodic'), ['buildtool_depends'])


def test_the_licence_is_a_file_with_its_text():
    licence, = package_for('noetic').licenses
    with open(os.path.join(ROOT, licence.file)) as stream:
        assert stream.readline().strip() == 'BSD 3-Clause License' and licence == 'BSD-3-Clause'
