"""What the tools for a release read: package.xml, the changelog, and what Debian has for each key."""
import os

import pytest
import yaml
from catkin_pkg.changelog import Changelog, populate_changelog_from_rst
from catkin_pkg.package import parse_package
from catkin_pkg.package_version import get_forthcoming_label, rename_section

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
KINDS = ('buildtool_depends', 'build_depends', 'build_export_depends', 'exec_depends', 'test_depends')
# As rosdep, bloom and catkin see each release; Debian's own ROS tells nobody its name before it is sourced.
RELEASES = {'melodic': '2', 'noetic': '3', '': '3'}


def package_for(distro):
    """package.xml as its conditions make it for a release of ROS."""
    warnings = []
    package = parse_package(os.path.join(ROOT, 'package.xml'), warnings=warnings)
    package.validate(warnings=warnings)
    assert warnings == []
    package.evaluate_conditions({'ROS_VERSION': '1', 'ROS_DISTRO': distro, 'ROS_PYTHON_VERSION': RELEASES[distro]})
    return package


def keys_of(package, kinds=KINDS):
    """Names of the dependencies whose conditions hold."""
    return set(depend.name for kind in kinds for depend in getattr(package, kind) if depend.evaluated_condition)


def changelog_text():
    with open(os.path.join(ROOT, 'CHANGELOG.rst')) as stream:
        return stream.read()


def released(text):
    """The versions in a changelog and their lines, as catkin_prepare_release and bloom read them."""
    changelog = populate_changelog_from_rst(Changelog('ros_3d_bb'), text)
    return {version: [str(bullet) for part in content for bullet in part]
            for version, _date, content in changelog.foreach_version()}


def test_every_line_of_the_newest_section_is_read():
    """As a version of its own, which catkin_prepare_release makes of what is forthcoming."""
    text = changelog_text()
    label = get_forthcoming_label(text)
    if label:
        text = rename_section(text, label, '99.0.0 (2030-01-01)')
    version = '99.0.0' if label else package_for('noetic').version
    lines = released(text)[version]
    written = text.split('\n%s (' % version)[1].split('\n\n')[0].split('\n* ')[1:]
    assert [line.split() for line in lines] == [line.split() for line in written]


def test_the_version_is_the_last_that_was_released():
    """0.1.0 stands for none."""
    versions = released(changelog_text())
    newest = max(versions, key=lambda name: [int(part) for part in name.split('.')]) if versions else '0.1.0'
    assert package_for('noetic').version == newest


@pytest.mark.parametrize('distro', sorted(RELEASES))
def test_no_key_is_one_of_pip(distro):
    """Bloom resolves each kind of dependency, those of tests too, and takes apt's only."""
    assert [key for key in keys_of(package_for(distro)) if key.endswith('-pip')] == []


def test_torch_is_asked_for_where_the_system_has_it():
    assert [distro for distro in sorted(RELEASES) if 'python3-torch' in keys_of(package_for(distro))] == ['']
    assert keys_of(package_for('')) - keys_of(package_for('noetic')) == {'python3-torch', 'tf2_tools'}


def test_on_melodic_what_its_python_2_leaves_out_is_asked_for():
    more = keys_of(package_for('melodic')) - keys_of(package_for('noetic'))
    assert more == {'python3-empy', 'python3-gnupg', 'python3-pycryptodome'}
    assert 'python3-catkin-pkg-modules' in keys_of(package_for('melodic'), ['buildtool_depends'])


def test_every_key_has_its_packages_of_debian_in_the_table():
    with open(os.path.join(ROOT, '.ci', 'rosdep_debian.yaml')) as stream:
        table = yaml.safe_load(stream)
    package = parse_package(os.path.join(ROOT, 'package.xml'))
    assert set(table) == set(depend.name for kind in KINDS for depend in getattr(package, kind))
    for key, systems in table.items():
        assert list(systems) == ['debian'] and systems['debian'], key


def test_the_licence_is_a_file_with_its_text():
    licence, = package_for('noetic').licenses
    with open(os.path.join(ROOT, licence.file)) as stream:
        assert stream.readline().strip() == 'BSD 3-Clause License' and licence == 'BSD-3-Clause'
