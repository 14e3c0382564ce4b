"""View of one measurement: images, people, truth, and position on the floor."""
import html

from ros_3d_bb.estimation.box3d_estimator import estimator_named
from ros_3d_bb_annotator.document import ESTIMATOR
from ros_3d_bb_annotator.grid_view import FloorScene, GridView
from ros_3d_bb_annotator.image_view import ImageView
from ros_3d_bb_annotator.marking import MarkedBox, Scene
from ros_3d_bb_annotator.pictures import PictureCache, depth_scale
from ros_3d_bb_annotator.qt import Qt, QtWidgets, Signal
from ros_3d_bb_annotator.shared_view import SharedView
from ros_3d_bb_annotator.truth_panel import TruthPanel

STATE_COLORS = {'new': '#3c78c8', 'annotated': '#1e8c3c', 'rejected': '#787878'}
HEADER = '<span style="font-size: large"><b>%s</b></span> &nbsp; <b style="color: %s">%s</b> &nbsp; %s'


class MeasurementPane(QtWidgets.QWidget):
    """View of one measurement of a document. `person_chosen` is emitted with the index of a detection.

    `truth`, `floor` and `shared` have the signals for other user actions.
    """

    person_chosen = Signal(int)

    def __init__(self, parent=None):
        super(MeasurementPane, self).__init__(parent)
        self.shared, self.truth, self.floor = SharedView(self), TruthPanel(), GridView()
        self.color_view, self.depth_view = ImageView('colour', self.shared), ImageView('depth', self.shared)
        self.header, self.banner = _label(), _label()
        self.readout = QtWidgets.QLabel()
        self.people, self.buttons = QtWidgets.QListWidget(), QtWidgets.QGridLayout()
        self._document, self._pictures, self._measurement, self._shown = None, None, None, None
        self._scale, self._samples_shown = depth_scale(), True
        self._lay_out()
        self.header.setText('No session is open: File, Open a session (Ctrl+O).')
        for view in (self.color_view, self.depth_view):
            view.box_chosen.connect(self.person_chosen)
        self.people.setAlternatingRowColors(True)
        for signal in (self.people.itemActivated, self.people.itemClicked):
            signal.connect(lambda item: self.person_chosen.emit(self.people.row(item)))
        self.shared.pointed.connect(self._show_readout)
        self.truth.previewed.connect(self._show_floor)

    def set_usable(self, usable):
        """Enable the widgets if there is a current measurement."""
        for widget in (self.color_view, self.depth_view, self.people, self.truth, self.floor):
            widget.setEnabled(usable)

    def show_document(self, document):
        """Set the document. No measurement is shown yet."""
        self._document, self._pictures, self._shown = document, PictureCache(document), None
        self.read_ahead, self.read_again = self._pictures.read_ahead, self._pictures.clear
        self.header.setText('This session contains no measurements yet.')
        self.banner.setText('<br>'.join(html.escape(note) for note in document.notes))
        self.banner.setVisible(bool(document.notes))

    def show_measurement(self, number):
        """Show a measurement, also if it has changed."""
        self._measurement = measurement = self._document.measurements[number]
        self._shown = pictures = self._pictures.of(number)
        self._show_header(measurement)
        image = pictures.color_image or pictures.depth_image
        if image is not None:
            self.shared.show_size(image.width(), image.height())
        self.shared.cancel()
        scene = self._scene()
        self.color_view.show_image(pictures.color_image, scene, pictures.color_problem)
        self.depth_view.show_image(pictures.depth_image, scene, pictures.depth_problem,
                                   (self._scale, '%g m' % pictures.farthest_m, '0 m') if pictures.depth else None)
        self._show_people(measurement)
        self.truth.show_truth(measurement.truth_m, measurement.estimate_m, self._document.draft(number))
        self._show_readout()

    def show_samples(self, shown):
        self._samples_shown = shown
        if self._measurement is not None:
            scene = self._scene()
            self.color_view.show_scene(scene)
            self.depth_view.show_scene(scene)

    def _scene(self):
        return _scene_of(self._measurement, self._shown.depth if self._samples_shown else None)

    def _show_header(self, measurement):
        details = [text for text in (measurement.label, measurement.stamp_text and 'at %s s' % measurement.stamp_text,
                                     measurement.rejected and 'because: %s' % measurement.rejected,
                                     measurement.problem) if text]
        self.header.setText(HEADER % (html.escape(measurement.id), STATE_COLORS[measurement.state], measurement.state,
                                      html.escape(' · '.join(details))))

    def _show_people(self, measurement):
        self.people.clear()
        for number, detection in enumerate(measurement.detections):
            item = QtWidgets.QListWidgetItem(_detection_text(number, detection))
            font = item.font()
            font.setBold(number == measurement.person)
            item.setFont(font)
            self.people.addItem(item)
        if measurement.person is not None:
            self.people.setCurrentRow(measurement.person)

    def _show_readout(self):
        depth, camera = (self._shown.depth, self._document.camera) if self._shown is not None else (None, None)
        self.readout.setText(_readout_text(self.shared.cursor, depth, camera))

    def _show_floor(self, truth_m):
        """Show the floor with the typed truth (x, z), or without truth for None."""
        estimate_m, camera = self._measurement.estimate_m, self._document.camera
        sight = (0.0, 0.0) if camera is None else (-camera.cx / camera.fx, (camera.width - camera.cx) / camera.fx)
        self.floor.show_scene(FloorScene(self._document.grid, truth_m,
                                         None if estimate_m is None else tuple(estimate_m[[0, 2]].tolist()), sight))

    def _lay_out(self):
        views = QtWidgets.QSplitter(Qt.Horizontal)
        views.addWidget(self.color_view)
        views.addWidget(self.depth_view)
        self.banner.setStyleSheet('background: #fff3c4; color: #5c4400; padding: 6px')
        self.banner.hide()
        self.readout.setTextInteractionFlags(Qt.TextSelectableByMouse)
        layout = QtWidgets.QVBoxLayout(self)
        layout.setContentsMargins(6, 6, 6, 0)
        for widget, stretch in ((self.banner, 0), (self.header, 0), (views, 1), (self.readout, 0)):
            layout.addWidget(widget, stretch)
        layout.addLayout(self._lower_part())

    def _lower_part(self):
        people_box, floor_box = QtWidgets.QGroupBox('Boxes: which is the person?'), QtWidgets.QGroupBox('Floor')
        QtWidgets.QVBoxLayout(people_box).addWidget(self.people)
        middle = QtWidgets.QVBoxLayout()
        middle.addWidget(self.truth, 1)
        middle.addLayout(self.buttons)
        floor_layout = QtWidgets.QVBoxLayout(floor_box)
        floor_layout.setContentsMargins(4, 4, 4, 4)
        floor_layout.addWidget(self.floor)
        layout = QtWidgets.QHBoxLayout()
        layout.addWidget(people_box, 3)
        layout.addLayout(middle, 4)
        layout.addWidget(floor_box, 4)
        return layout


def _label():
    label = QtWidgets.QLabel()
    label.setTextFormat(Qt.RichText)
    label.setWordWrap(True)
    return label


def _scene_of(measurement, depth):
    """Overlay of a measurement. With a DepthImage it contains the samples of the estimator in each box."""
    boxes = []
    for number, detection in enumerate(measurement.detections):
        if detection.box_px is not None:
            distance = '' if detection.estimate_m is None else ': %.2f m' % detection.estimate_m[2]
            boxes.append(MarkedBox(number, detection.box_px, '%d%s' % (number + 1, distance), detection.by_hand))
    sample = estimator_named(ESTIMATOR).sample
    samples = () if depth is None else tuple(
        sample(depth, box.rect_px) for box in boxes
        if box.rect_px[0] < box.rect_px[2] and box.rect_px[1] < box.rect_px[3])
    return Scene(tuple(boxes), measurement.person, samples)


def _detection_text(number, detection):
    """Description of a detection in two lines."""
    position = 'no estimate' if detection.estimate_m is None else (
        'X %s  Z %.3f m' % (_signed(detection.estimate_m[0]), detection.estimate_m[2]))
    details = (detection.support is not None and 'support %.0f %%' % (100 * detection.support),
               detection.truncated and 'truncated', detection.by_hand and 'drawn by hand')
    return '%d: %s\n     %s' % (number + 1, position, ', '.join(filter(None, details)))


def _readout_text(cursor, depth, camera):
    """Text with pixel, depth and position at the cursor (u, v) or None. `depth` is a DepthImage or None."""
    if cursor is None:
        return 'Point at the image: pixel, depth, X Y Z'
    text = 'pixel (%d, %d)' % cursor
    if depth is None:
        return text
    depth_m, valid = depth.at(*cursor)
    if not valid:
        return text + '    no depth there'
    x_m, y_m, z_m = camera.deproject(cursor, depth_m).tolist()
    return text + '    depth %.3f m    X %s  Y %s  Z %.3f m' % (depth_m, _signed(x_m), _signed(y_m), z_m)


def _signed(value_m):
    """Format metres with a sign, with a minus sign as wide as the plus sign."""
    return ('%+.3f' % value_m).replace('-', '−')
