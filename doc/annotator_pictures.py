"""Make the pictures of viewer and annotator in doc/images: a session of simulated people, in its own window.

PYTHONPATH=src:annotator xvfb-run -a python3 doc/annotator_pictures.py doc/images (or ./run pictures)
"""
import json
import os
import sys
import tempfile

import cv2
import numpy as np

from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.box3d_estimator import estimate_boxes, estimator_named
from ros_3d_bb.nodes.viewer_node import KEYS
from ros_3d_bb.sessions.frame_synchronizer import ColorImage, Snapshot
from ros_3d_bb.sessions.session_writer import box_entry
from ros_3d_bb.visualization.viewer_layout import compose, draw_countdown
from ros_3d_bb_annotator.main_window import AnnotatorWindow, make_application
from ros_3d_bb_annotator.qt import QtGui
from ros_3d_bb_lab.simulation.scenario import Person, Robot, Room, Scenario
from ros_3d_bb_lab.simulation.simulator import D435I_COLOR, Simulator

ROOM, ROBOT = Room(bounds=(-2.0, 7.0, -3.0, 3.0)), Robot()
PLACES_M = [(x, z) for z in (1.5, 2.0, 2.5, 3.0, 4.0) for x in (-0.5, 0.0, 0.5)]
PASSER_BY_M = (-0.9, 4.4)
IMPLAUSIBLE_M = {7: 1.0}  # slips in truth by the number of the measurement
COLORS = 128
SIZE_PX = 1400, 860
VIEWER_PANEL_PX, STAMP_NS = 320, 1616161686 * NS


def write_session(folder):
    """Write a session with a person on each mark, and somebody passing by behind."""
    for name in ('color', 'depth'):
        os.makedirs(os.path.join(folder, name), exist_ok=True)
    frames = [_write_frame(folder, number, place) for number, place in enumerate(PLACES_M)]
    camera = dict(D435I_COLOR._asdict(), distortion=[0] * 5, depth_scale=0.001, frame='camera_color_optical_frame')
    grid = [{'name': _mark(number), 'x': 1000 * x_m, 'z': 1000 * z_m} for number, (x_m, z_m) in enumerate(PLACES_M)]
    with open(os.path.join(folder, 'frames.json'), 'w') as stream:
        json.dump({'camera': camera, 'grid': grid, 'frames': frames}, stream)


def _simulated(number, place):
    people = tuple(Person(_map_from(x_m, z_m), heading) for (x_m, z_m), heading in ((place, 3.0), (PASSER_BY_M, 1.2)))
    return Simulator(Scenario(duration=1.0, rate=1.0, seed=number, room=ROOM, robot=ROBOT, people=people)).frame(0)


def _boxes_of(frame):
    return [tuple(int(edge) for edge in person.box_px) for person in frame.people if person.box_px is not None]


def _write_frame(folder, number, place):
    frame = _simulated(number, place)
    name = '%03d.png' % number
    cv2.imwrite(os.path.join(folder, 'color', name), frame.color[..., ::-1])
    cv2.imwrite(os.path.join(folder, 'depth', name), frame.depth_mm)
    boxes_px = _boxes_of(frame)
    estimates = estimate_boxes(DepthImage(frame.depth_mm, 0.001), boxes_px, D435I_COLOR, estimator_named('foreground'))
    detections = [dict({} if box is None else box_entry(box), box=box_px) for box_px, box in zip(boxes_px, estimates)]
    return {'id': '%03d' % number, 'color': 'color/' + name, 'depth': 'depth/' + name, 'label': _mark(number),
            'stamp': '%d.%09d' % (1616161616 + 7 * number, 123456789), 'detections': detections}


def _mark(number):
    """Name of the floor mark of a measurement."""
    return 'ABC'[number % 3] + str(number // 3 + 1)


def _map_from(x_m, z_m):
    """The place (x, y) of the map that is at (x, z) of the camera."""
    return ROBOT.pose[0] + ROBOT.mount[0] + z_m, ROBOT.pose[1] - x_m


def take_pictures(session, folder):
    """Annotate a part of the session, and write the pictures."""
    application = make_application()
    window = AnnotatorWindow()
    window.resize(*SIZE_PX)
    window.show()
    window.open_session(session)
    for number, (x_m, z_m) in enumerate(PLACES_M[:10]):
        if number == 4:
            window.document.reject(4, 'not on the mark')
        else:
            window.document.set_truth(number, x_m, z_m + IMPLAUSIBLE_M.get(number, 0))
    window.after_edit()
    window.show_measurement(10)
    window.pane.truth.fields['x'].setText('0')
    window.pane.truth.fields['z'].setText('3000')
    window.pane.truth.fields['z'].textEdited.emit('3000')
    window.pane.shared.point_at(340, 150)
    application.processEvents()
    _save(window, os.path.join(folder, 'annotator.png'))
    window.document.restore(4)  # each cluster needs three measurements
    for number in [4] + list(IMPLAUSIBLE_M) + list(range(10, len(PLACES_M))):
        window.document.set_truth(number, *PLACES_M[number])
    window.actions['analyse'].trigger()
    while window.results.figures is None:
        application.processEvents()
    window.results.figures.names.setCurrentRow(1)
    application.processEvents()
    _save(window.results.figures, os.path.join(folder, 'annotator_analysis.png'))
    window.close()


def take_viewer_picture(path):
    """Write what viewer_node shows of a measurement, three seconds before a burst."""
    frame = _simulated(10, PLACES_M[10])
    depth, boxes_px = DepthImage(frame.depth_mm, 0.001), _boxes_of(frame)
    boxes = [box for box in estimate_boxes(depth, boxes_px, D435I_COLOR, estimator_named('foreground')) if box]
    snapshot = Snapshot(STAMP_NS, ColorImage(frame.color, 'camera_color_optical_frame'), depth, None, boxes_px, boxes)
    lines = ('30.0 images/s    stamp %d.%09d    3D boxes: %d' % (divmod(STAMP_NS, NS) + (len(boxes),)),
             'session: campaign    label: %s' % _mark(10), KEYS)
    picture = draw_countdown(compose(snapshot, VIEWER_PANEL_PX, 6.0, lines), '3')
    height, width = picture.shape[:2]
    _save_image(QtGui.QImage(picture.tobytes(), width, height, 3 * width, QtGui.QImage.Format_RGB888), path)


def _save(widget, path):
    _save_image(widget.grab().toImage(), path)


def _save_image(image, path):
    """Save a picture with a palette of its own: a third of the size."""
    image = image.convertToFormat(QtGui.QImage.Format_RGB32)
    pixels = np.frombuffer(image.constBits().asarray(image.byteCount()), np.uint8)
    pixels = pixels.reshape(-1, 4)[:, :3].astype(np.float32)
    chosen = np.random.RandomState(0).permutation(len(pixels))[:30000]
    criteria = cv2.TERM_CRITERIA_MAX_ITER + cv2.TERM_CRITERIA_EPS, 10, 1.0
    _error, _labels, palette = cv2.kmeans(pixels[chosen], COLORS, None, criteria, 1, cv2.KMEANS_PP_CENTERS)
    places, _distances = cv2.batchDistance(pixels, palette, cv2.CV_32F, K=1)[::-1]
    indexed = QtGui.QImage(np.ascontiguousarray(places[:, 0], np.uint8).tobytes(), image.width(), image.height(),
                           image.width(), QtGui.QImage.Format_Indexed8)
    indexed.setColorTable([QtGui.qRgb(*color[::-1]) for color in np.rint(palette).astype(int).tolist()])
    indexed.save(path)


if __name__ == '__main__':
    with tempfile.TemporaryDirectory() as place:
        write_session(os.path.join(place, 'session'))
        take_pictures(os.path.join(place, 'session'), sys.argv[1])
    take_viewer_picture(os.path.join(sys.argv[1], 'campaign_viewer.png'))
