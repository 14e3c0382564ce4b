"""RealSense driver on recordings that librealsense records and plays; no camera is needed."""
import sys

import numpy as np
import pyrealsense2 as rs
import pytest

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, transform_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.drivers import realsense
from ros_3d_bb.drivers.realsense import CameraLost, RealSense, RealSenseParams, camera_from_intrinsics, frame_links
from support.realsense_recordings import (COLOR_CAMERA, DEPTH_FROM_COLOR, FRAMES, SKIPPED, START_MS, STEP_MS, SUFFIX,
                                          colored, intrinsics_of, sloping_depth, write_recording)


def play(path, count, **params):
    """Camera of a recording that is played as fast as it is read, and its first `count` frames."""
    camera = RealSense(RealSenseParams(file=path, real_time=False, **params))
    frames = []
    while len(frames) < count and not camera.is_over:
        frame = camera.read()
        frames += [frame] if frame is not None else []
    camera.close()
    return camera, frames


@pytest.fixture(scope='module')
def played(recording):
    return play(recording, FRAMES + 1)


def test_all_images_of_a_recording_are_read_with_their_stamps(played):
    camera, frames = played
    skipped = FRAMES - len(frames)
    assert camera.is_over and 0 <= skipped <= SKIPPED
    for number, (stamp_ns, color, depth) in enumerate(frames, skipped):
        assert abs(stamp_ns - (START_MS + number * STEP_MS) * 1e6) < 1000
        np.testing.assert_array_equal(color, colored(number))
        assert depth.scale_m == 0.001 and depth.values.dtype == np.uint16


def test_points_of_colour_and_depth_agree_in_the_published_frames(played):
    camera, _frames = played
    links = {child: (parent, matrix) for parent, child, matrix in frame_links('front', camera.link_from_color)}
    assert set(links) == {'front_color_frame', 'front_color_optical_frame', 'front_depth_frame',
                          'front_depth_optical_frame'}
    link_from_color, link_from_depth = (
        links['front_%s_frame' % stream][1].dot(links['front_%s_optical_frame' % stream][1])
        for stream in ('color', 'depth'))
    np.testing.assert_allclose(link_from_color, link_from_depth.dot(DEPTH_FROM_COLOR), atol=1e-6)
    np.testing.assert_allclose(links['front_depth_optical_frame'][1], transform_from((0, 0, 0), OPTICAL_ROTATION))
    # realsense2_camera's publish_static_tf: x, y, z of the body are z, -x, -y of the optical frame
    x, y, z = DEPTH_FROM_COLOR[:3, 3]
    np.testing.assert_allclose(links['front_color_frame'][1][:3, 3], (z, -x, -y), atol=1e-6)


def test_stamps_without_metadata_follow_the_clock_of_the_camera(tmp_path):
    path = write_recording(str(tmp_path / ('old' + SUFFIX)), [colored(0)] * 3, [sloping_depth()] * 3,
                           clock=rs.timestamp_domain.hardware_clock, start_ms=5000.0)
    # On a busy machine, librealsense may pair two depth images with one colour image, whose stamp is then repeated.
    stamps = np.unique([stamp_ns for stamp_ns, _color, _depth in play(path, 3)[1]])
    assert stamps[0] > 1600000000 * NS and len(stamps) > 1
    np.testing.assert_allclose(np.diff(stamps), STEP_MS * 1e6, atol=10)


def test_a_camera_that_stops_sending_is_lost(recording, monkeypatch):
    """A recording in place of a camera that is unplugged when the recording ends."""
    config = rs.config()
    config.enable_device_from_file(recording, False)
    monkeypatch.setattr(realsense, '_config', lambda _rs, _params: config)
    monkeypatch.setattr(realsense, 'LOST_S', 0.3)
    camera = RealSense(RealSenseParams())
    with pytest.raises(CameraLost):
        for _attempt in range(100):
            camera.read()
    camera.close()


def test_a_missing_camera_is_lost():
    with pytest.raises(CameraLost, match='123 .*640 x 480 .*30 Hz'):
        RealSense(RealSenseParams(serial='123'))


@pytest.mark.parametrize('name, model, kept', [
    ('none', '', 0), ('brown_conrady', 'plumb_bob', 5), ('inverse_brown_conrady', 'inverse_brown_conrady', 5),
    ('modified_brown_conrady', 'inverse_brown_conrady', 5), ('kannala_brandt4', 'equidistant', 4)])
def test_distortion_models_are_mapped_to_equal_formulas(name, model, kept):
    intrinsics = intrinsics_of(COLOR_CAMERA, getattr(rs.distortion, name))
    camera = camera_from_intrinsics(intrinsics)
    assert camera.distortion_model == model and len(camera.distortion) == kept
    for point in ([0.3, -0.2, 1.5], [-0.5, 0.3, 1.0]):
        np.testing.assert_allclose(camera.project(point), rs.rs2_project_point_to_pixel(intrinsics, point), atol=0.01)


@pytest.mark.parametrize('name, named', [
    ('here.bag', "'here.bag'"), ('/nowhere/there.bag', 'there.bag'), ('no.bag', 'no.bag cannot be played')])
def test_files_that_cannot_be_played_are_rejected(tmp_path, name, named):
    (tmp_path / 'no.bag').write_text('#ROSBAG V2.0\n')
    with pytest.raises(ValueError, match=named):
        RealSense(RealSenseParams(file=str(tmp_path / name) if name == 'no.bag' else name))


def test_without_librealsense_the_error_names_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, 'pyrealsense2', None)
    with pytest.raises(ValueError, match='pip3 install pyrealsense2.*driver:=realsense2_camera'):
        RealSense(RealSenseParams())
