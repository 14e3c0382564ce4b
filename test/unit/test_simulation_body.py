"""Body model: connected joints, feet on the floor, and bodies of the requested size."""
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_3d_bb_lab.simulation.body import Body, Build
from ros_3d_bb_lab.simulation.gait import (BONES, JOINTS_M, PARENTS, STANCE, TABLE_HEIGHT_M, Posture, bone_transforms,
                                           stride_m)
from ros_3d_bb_lab.simulation.mesh import volume
from support.meshes import assert_closed

postures = st.tuples(st.floats(-3, 3), st.floats(0, 1), st.floats(0, 1)).map(lambda values: Posture(*values))
builds = st.tuples(st.floats(1.4, 2.1), st.floats(.9, 1.4), st.floats(0, 1), st.booleans(), st.booleans()).map(
    lambda values: Build(*values))


@pytest.fixture(scope='module')
def body():
    return Body(Build(), np.random.RandomState(0))


def joint(posture, bone, name):
    """Position of a joint that is attached to a bone, in a posture."""
    return bone_transforms(posture)[BONES.index(bone)].dot(np.append(JOINTS_M[name], 1))


def shoe(body, side):
    """Indices of the vertices of a shoe; `side` 1 is the left one."""
    standing = body.posed()
    used = standing.faces[(standing.colors == body.build.shoes).all(axis=1)]
    return np.array([number for number in np.unique(used) if standing.vertices[number, 1] * side > 0])


@given(postures)
@settings(max_examples=30)
def test_bones_are_connected_at_their_joints(posture):
    for bone, parent in PARENTS[1:]:
        np.testing.assert_allclose(joint(posture, bone, bone), joint(posture, parent, bone), atol=1e-12)


@given(st.floats(-2, 2), st.floats(0, 1), st.floats(0, 1))
@settings(max_examples=50)
def test_left_and_right_are_exchanged_after_half_a_cycle(phase, swing, crouch):
    now, later = Posture(phase, swing, crouch), Posture(phase + .5, swing, crouch)
    for name in ('forearm_l', 'shin_l', 'foot_l'):
        mirrored = joint(later, name[:-1] + 'r', name[:-1] + 'r') * (1, -1, 1)
        np.testing.assert_allclose(joint(now, name, name), mirrored, atol=1e-9)


@given(postures)
@settings(max_examples=30)
def test_the_gait_is_periodic_and_continuous(posture):
    after = [bone_transforms(posture._replace(phase=posture.phase + shift)) for shift in (0, 1e-4, 1)]
    np.testing.assert_allclose(after[0], after[2], atol=1e-9)
    assert np.abs(after[1] - after[0]).max() < .005


@given(st.floats(0, 1))
def test_crouching_keeps_feet_and_body_over_the_origin(body, crouch):
    """Within 12 cm, as documented: the feet move back and forth while the body is lowered."""
    ankles = [joint(Posture(crouch=crouch), 'foot_' + side, 'foot_' + side) for side in 'lr']
    assert np.abs(np.mean(ankles, axis=0)[:2]).max() < .12
    assert np.abs(body.posed(Posture(crouch=crouch)).vertices.mean(axis=0)[:2]).max() < .1


@pytest.mark.parametrize('swing,slip_m', [(1, .03), (.8, .025), (.5, .015)])
def test_the_ankle_hardly_slides_during_stance(swing, slip_m):
    """Measured: 26 mm at full swing, while the foot rolls from heel to toe and the body moves by 0.59 m."""
    phases = np.linspace(0, STANCE, 51)
    ankle_x = [joint(Posture(phase, swing), 'foot_l', 'foot_l')[0] for phase in phases]
    on_floor = ankle_x + phases * stride_m(TABLE_HEIGHT_M, swing)
    assert np.ptp(on_floor) < slip_m
    assert on_floor[0] == pytest.approx(on_floor[-1], abs=1e-9)  # no drift over many steps


def test_stride_grows_with_height_and_swing_and_is_realistic():
    assert stride_m(1.75) == pytest.approx(1.2, abs=.1)
    assert stride_m(2 * 1.75) == pytest.approx(2 * stride_m(1.75))
    strides = [stride_m(1.75, swing) for swing in (0, .25, .5, .75, 1)]
    assert abs(strides[0]) < .01 and (np.diff(strides) > .2).all()


@given(postures)
@settings(max_examples=30)
def test_the_lowest_point_is_on_the_floor_and_the_head_no_higher_than_standing(body, posture):
    vertices = body.posed(posture).vertices
    assert vertices[:, 2].min() == 0
    assert vertices[:, 2].max() < body.build.height_m + .02


@given(builds)
@settings(max_examples=10)
def test_a_body_consists_of_closed_parts_and_has_a_realistic_volume(build):
    mesh = Body(build, np.random.RandomState(0)).posed()
    assert_closed(mesh.faces)
    slim_litres = 85 * (build.height_m / 1.75) ** 3
    assert .8 < volume(mesh.vertices, mesh.faces) * 1000 / (slim_litres * build.girth ** 2) < 1.3


@given(postures)
@settings(max_examples=20)
def test_postures_keep_the_volume_and_unit_normals(body, posture):
    mesh, standing = body.posed(posture), body.posed()
    assert volume(mesh.vertices, mesh.faces) == pytest.approx(volume(standing.vertices, standing.faces), rel=.05)
    assert np.median(np.abs(np.linalg.norm(mesh.normals, axis=1) - 1)) < 1e-5


@given(builds)
@settings(max_examples=20)
def test_the_width_includes_the_shoulders_and_excludes_the_hands(build):
    body = Body(build, np.random.RandomState(0))
    vertices = body.posed().vertices / build.height_m * TABLE_HEIGHT_M
    shoulders = vertices[vertices[:, 2] > JOINTS_M['arm_l'][2] - .005]
    radius = body.width_m / 2 / build.height_m * TABLE_HEIGHT_M
    assert radius - .01 < np.hypot(shoulders[:, 0], shoulders[:, 1]).max() < radius + .002
    assert np.abs(vertices[:, 1]).max() > radius


def test_the_body_faces_x_and_its_left_is_y(body):
    standing, walking = body.posed(), body.posed(Posture(0, 1))
    np.testing.assert_allclose(standing.vertices[:, 1].min(), -standing.vertices[:, 1].max(), atol=1e-5)
    nose = standing.vertices[standing.vertices[:, 2] > 1.6]
    assert nose[:, 0].max() > .1 and nose[:, 0].max() > -nose[:, 0].min()
    for side, ahead in ((1, True), (-1, False)):  # the left heel strikes at phase 0
        assert (walking.vertices[shoe(body, side), 0].mean() > .2) == ahead


def test_clothes_and_hair_are_those_of_the_build():
    build = Build(shirt=(1, 2, 3), trousers=(4, 5, 6), hair=(7, 8, 9), skin=(10, 11, 12), shoes=(13, 14, 15))
    bodies = [Body(build._replace(**change), np.random.RandomState(0)).posed()
              for change in ({}, {'long_hair': True}, {'short_sleeves': True})]
    for mesh in bodies:
        assert {tuple(color) for color in mesh.colors} == {build.shirt, build.trousers, build.hair, build.skin,
                                                           build.shoes}
    lowest_hair = [mesh.vertices[mesh.faces[(mesh.colors == build.hair).all(axis=1)], 2].min() for mesh in bodies]
    assert lowest_hair[1] < lowest_hair[0] - .1
    skin = [(mesh.colors == build.skin).all(axis=1).sum() for mesh in bodies]
    assert skin[2] > skin[0]
