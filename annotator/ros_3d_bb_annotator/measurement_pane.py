"""View of one measurement: images, people, truth, and position on the floor."""
import html

import numpy as np

from ros_3d_bb.estimation.box3d_estimator import estimator_named
from ros_3d_bb.sessions.plausibility import position_text
from ros_3d_bb.sessions.session_reader import NOBODY
from ros_3d_bb.visualization.image_overlay import DEPTH_RANGE_M, colorize_depth, depth_to_grey
from ros_3d_bb_annotator.estimates import ESTIMATOR
from ros_3d_bb_annotator.grid_view import FloorScene, GridView
from ros_3d_bb_annotator.image_view import ImageView, Panel
from ros_3d_bb_annotator.lengths import length_text
from ros_3d_bb_annotator.marking import MarkedBox, Scene
from ros_3d_bb_annotator.measurement_list import COLORS, IMPLAUSIBLE
from ros_3d_bb_annotator.qt import Qt, QtGui, QtWidgets, Signal
from ros_3d_bb_annotator.truth_panel import TruthPanel, error_text
from ros_3d_bb_annotator.validation import truth_problems

NOBODY_TEXT = 'Nobody was found: draw a box around the person (Shift and drag), or reject the measurement (Ctrl+R).'
HEADER = '<span style="font-size: large"><b>%s</b></span> &nbsp; <b style="color: %s">%s</b> &nbsp; %s'


class MeasurementPane(QtWidgets.QWidget):
    """View of one measurement of a document. `person_chosen` is emitted with the index of a detection.

    `truth`, `floor` and `images` have the signals for other user actions.
    """

    person_chosen = Signal(int)

    def __init__(self, parent=None):
        super(MeasurementPane, self).__init__(parent)
        self.images, self.truth, self.floor = ImageView(), TruthPanel(), GridView()
        self.header, self.banner = _label(), _label()
        self.banner.setText(NOBODY_TEXT)
        self.readout = QtWidgets.QLabel()
        self.people, self.buttons = QtWidgets.QListWidget(), QtWidgets.QHBoxLayout()
        self._document, self._measurement, self._depth, self._shown_files, self._index = (None,) * 5
        self._lay_out()
        self.header.setText('No session is open: File, Open a session (Ctrl+O).')
        self.images.box_chosen.connect(self.person_chosen)
        self.people.setAlternatingRowColors(True)
        self.people.setWordWrap(True)
        self.people.setHorizontalScrollBarPolicy(Qt.ScrollBarAlwaysOff)
        for signal in (self.people.itemActivated, self.people.itemClicked):
            signal.connect(lambda item: self.person_chosen.emit(self.people.row(item)))
        self.images.pointed.connect(self._show_readout)
        self.truth.previewed.connect(self._show_preview)

    def set_usable(self, usable):
        for widget in (self.images, self.people, self.truth, self.floor):
            widget.setEnabled(usable)

    def show_document(self, document):
        self._document, self._measurement, self._depth, self._shown_files = document, None, None, None
        self.header.setText('This session contains no measurements yet.')
        self.banner.hide()

    def show_measurement(self, number):
        """Show a measurement, also if it has changed. The text that is typed for it remains."""
        before, self._index = self._measurement, number
        self._measurement = measurement = self._document.measurements[number]
        files = measurement.id, measurement.color_path, measurement.depth_path
        if files != self._shown_files:
            (self._panels, self._depth), self._shown_files = _read_panels(self._document, number), files
        self._document.estimates.of(number, self._depth)
        self._show_header(measurement)
        self.banner.setVisible(measurement.state == NOBODY)
        self.images.show_images(self._panels, self._scene())
        self._show_people(measurement)
        self.truth.show_truth(measurement.truth_m, self._document.mark_of(number),
                              before is not None and before.id == measurement.id)
        self._show_readout()

    def _show_header(self, measurement):
        details = [text for text in (measurement.label, measurement.stamp_text and 'at %s s' % measurement.stamp_text,
                                     measurement.rejected and 'reason: %s' % measurement.rejected,
                                     measurement.problem) if text]
        state = IMPLAUSIBLE if self._index in self._document.estimates.implausible() else measurement.state
        self.header.setText(HEADER % (html.escape(measurement.id), COLORS[state].name(), state,
                                      html.escape(' · '.join(details))))

    def _scene(self):
        """Overlay of the measurement: boxes, and if there is depth, the samples of the estimator in each of them."""
        boxes = []
        for number, (detection, position_m) in enumerate(
                zip(self._measurement.detections, self._document.estimates.of(self._index))):
            if detection.box_px is not None:
                distance = '' if position_m is None else ': %s' % length_text(position_m[2])
                boxes.append(MarkedBox(number, detection.box_px, '%d%s' % (number + 1, distance), detection.by_hand))
        sample = estimator_named(ESTIMATOR).sample
        samples = () if self._depth is None else tuple(
            sample(self._depth, box.rect_px) for box in boxes
            if box.rect_px[0] < box.rect_px[2] and box.rect_px[1] < box.rect_px[3])
        return Scene(tuple(boxes), self._measurement.person, samples)

    def _show_people(self, measurement):
        self.people.clear()
        positions = self._document.estimates.of(self._index)
        for number, (detection, position_m) in enumerate(zip(measurement.detections, positions)):
            item = QtWidgets.QListWidgetItem(
                _detection_text(number, detection, position_m, measurement.truths.get(number)))
            font = item.font()
            font.setBold(number == measurement.person)
            item.setFont(font)
            self.people.addItem(item)
        if measurement.person is not None:
            self.people.setCurrentRow(measurement.person)

    def _show_readout(self):
        camera = None if self._document is None else self._document.camera
        self.readout.setText(_readout_text(self.images.cursor, self._depth, camera))

    def _show_preview(self, truth_m):
        """Show error and floor for the typed truth (x, y, z), or without truth for None."""
        measurement, document = self._measurement, self._document
        person, warning = measurement.person, ''
        if truth_m is not None and person is not None:
            person = document.person_at(self._index, truth_m[0], truth_m[2])
            if person != measurement.person:
                warning = 'Box %d is the nearest: it is selected on Enter' % (person + 1)
            if truth_problems(document, self._index, truth_m):
                warning = 'Implausible: check position, unit and box'
        position_m = None if person is None else document.estimates.of(self._index)[person]
        error_m = None if truth_m is None or position_m is None else (
            float(position_m[0]) - truth_m[0], float(position_m[2]) - truth_m[2])
        self.truth.show_error(error_text(error_m), warning)
        camera = document.camera
        sight = -camera.cx / camera.fx, (camera.width - camera.cx) / camera.fx
        self.floor.show_scene(FloorScene(
            document.grid, None if truth_m is None else (truth_m[0], truth_m[2]),
            None if position_m is None else tuple(position_m[[0, 2]].tolist()), sight))

    def _lay_out(self):
        self.banner.setStyleSheet('background: #fff3c4; color: #5c4400; padding: 6px')
        self.banner.hide()
        self.readout.setTextInteractionFlags(Qt.TextSelectableByMouse)
        layout = QtWidgets.QVBoxLayout(self)
        layout.setContentsMargins(6, 6, 6, 0)
        for widget, stretch in ((self.banner, 0), (self.header, 0), (self.images, 1), (self.readout, 0)):
            layout.addWidget(widget, stretch)
        layout.addLayout(self._lower_part())

    def _lower_part(self):
        people_box, floor_box = QtWidgets.QGroupBox('Boxes'), QtWidgets.QGroupBox('Floor from above')
        QtWidgets.QVBoxLayout(people_box).addWidget(self.people)
        middle = QtWidgets.QVBoxLayout()
        middle.addWidget(self.truth, 1)
        middle.addLayout(self.buttons)
        floor_layout = QtWidgets.QVBoxLayout(floor_box)
        floor_layout.setContentsMargins(4, 4, 4, 4)
        floor_layout.addWidget(self.floor)
        layout = QtWidgets.QHBoxLayout()
        people_box.setMinimumWidth(self.fontMetrics().boundingRect('recorded: X −0000').width())
        layout.addWidget(people_box, 4)
        layout.addLayout(middle, 4)
        layout.addWidget(floor_box, 4)
        return layout


def _label():
    label = QtWidgets.QLabel()
    label.setTextFormat(Qt.RichText)
    label.setWordWrap(True)
    return label


def _detection_text(number, detection, position_m, truth_m):
    details = (detection.support is not None and 'support %.0f %%' % (100 * detection.support),
               detection.truncated and 'truncated', detection.by_hand and 'drawn by hand')
    lines = ('no estimate' if position_m is None else position_text(position_m[::2]),
             detection.estimate_m is not None and 'recorded: %s' % position_text(detection.estimate_m[::2]),
             truth_m is not None and 'true: %s' % position_text(truth_m[::2]), ', '.join(filter(None, details)))
    return '%d: %s' % (number + 1, '\n'.join(filter(None, lines)))


def _readout_text(cursor, depth, camera):
    """Text with pixel, depth and position at the cursor (u, v) or None. `depth` is a DepthImage or None."""
    if cursor is None:
        return 'Point at the image to read pixel, depth and position'
    text = 'pixel (%d, %d)' % cursor
    if depth is None:
        return text
    depth_m, valid = depth.at(*cursor)
    if not valid:
        return text + '    no depth'
    x_m, y_m, z_m = camera.deproject(cursor, depth_m).tolist()
    return text + '    depth %s    X %s  Y %s  Z %s' % (
        length_text(depth_m), length_text(x_m, True), length_text(y_m, True), length_text(z_m))


def _read_panels(document, number):
    color, color_problem = _read_or_error(document.color, number)
    depth, depth_problem = _read_or_error(document.depth, number)
    shown = None if depth is None else colorize_depth(depth_to_grey(depth, DEPTH_RANGE_M))
    return (Panel('colour', _image_of(color), color_problem), Panel('depth', _image_of(shown), depth_problem)), depth


def _image_of(rgb):
    if rgb is None:
        return None
    rgb = np.ascontiguousarray(rgb)
    height, width = rgb.shape[:2]
    return QtGui.QImage(rgb.data, width, height, 3 * width, QtGui.QImage.Format_RGB888).copy()


def _read_or_error(read, number):
    try:
        return read(number), ''
    except (ValueError, OSError) as error:
        return None, str(error)
