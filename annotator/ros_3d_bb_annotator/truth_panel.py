"""Fields for the truth of a measurement, and the resulting error."""
import contextlib
import math

from ros_3d_bb_annotator.lengths import METRES, parse_length
from ros_3d_bb_annotator.qt import QtCore, QtGui, QtWidgets, Signal

FIELDS = (('x', '&X, right of the camera'), ('z', '&Z, ahead of it'), ('y', '&Y, below it (optional)'))
UNITS = ('mm', 'm')
TYPING_MS = 300  # typed text is saved after a pause of this length


class LengthEdit(QtWidgets.QLineEdit):
    """Line edit that leaves undo and redo to the application if it has nothing to undo itself."""

    def event(self, event):
        if event.type() == QtCore.QEvent.ShortcutOverride and (
                (event.matches(QtGui.QKeySequence.Undo) and not self.isUndoAvailable())
                or (event.matches(QtGui.QKeySequence.Redo) and not self.isRedoAvailable())):
            event.ignore()
            return False
        return super(LengthEdit, self).event(event)


class TruthPanel(QtWidgets.QGroupBox):
    """Panel of the truth.

    Signals: `entered` with (x_m, z_m, y_m or None) when Enter is pressed on a complete position; `typed` with the text
    of the fields to be saved; `previewed` with the current (x_m, z_m), or None if incomplete.
    """

    entered = Signal(float, float, object)
    typed = Signal(dict)
    previewed = Signal(object)

    def __init__(self, parent=None):
        super(TruthPanel, self).__init__('Truth', parent)
        self.fields = {name: LengthEdit() for name, _label in FIELDS}
        self.unit_box = QtWidgets.QComboBox()
        self.unit_box.addItems(UNITS)
        self.error_label, self.hint_label = QtWidgets.QLabel(), QtWidgets.QLabel()
        self._estimate_m, self._stored = None, self.texts()
        self._timer = QtCore.QTimer(self, singleShot=True, interval=TYPING_MS)
        self._timer.timeout.connect(self.flush)
        self._lay_out()
        for field in self.fields.values():
            field.textEdited.connect(self._on_typed)
            field.returnPressed.connect(self._on_enter)
        self.unit_box.activated.connect(self._on_unit)

    def show_truth(self, truth_m, estimate_m, draft):
        """Show the truth (x, y, z) of a measurement or None, or its draft. `estimate_m` is (3,) or None."""
        self._timer.stop()
        self._estimate_m = estimate_m
        unit = draft.get('unit', self.unit_box.currentText())
        unit = unit if unit in UNITS else UNITS[0]
        self.unit_box.setCurrentText(unit)
        x_m, y_m, z_m = truth_m or (None, None, None)
        self._stored = {'x': _text_of(x_m, unit), 'z': _text_of(z_m, unit), 'y': _text_of(y_m, unit), 'unit': unit}
        shown = dict(self._stored, **draft)
        for name, field in self.fields.items():
            field.setText(shown[name])
        self._show_hint('typed, but not saved as truth yet: press Enter' if draft else '')
        self._show_error()

    def texts(self):
        """Text of the fields and the unit: {name: text}."""
        return dict({name: field.text() for name, field in self.fields.items()}, unit=self.unit_box.currentText())

    def begin(self):
        self.fields['x'].setFocus()
        self.fields['x'].selectAll()

    def has_keyboard(self):
        return any(field.hasFocus() for field in self.fields.values())

    def flush(self):
        """Emit `typed` immediately instead of after a pause."""
        self._timer.stop()
        texts = self.texts()
        edited = any(texts[name] != self._stored[name] for name in self.fields)
        self.typed.emit(texts if edited and any(texts[name] for name in self.fields) else {})

    def switch_unit(self):
        """Switch between millimetres and metres. Complete lengths are converted."""
        self.unit_box.setCurrentIndex(1 - self.unit_box.currentIndex())
        self._on_unit()

    def show_problem(self, text):
        self._show_hint(text, 'color: #b00020')

    def read(self):
        """Return (x_m, z_m, y_m or None). Raises ValueError with the name of the invalid field."""
        values_m = {}
        for name, field in self.fields.items():
            if name == 'y' and not field.text().strip():
                continue
            try:
                values_m[name] = parse_length(field.text(), self.unit_box.currentText())
            except ValueError as error:
                raise ValueError('%s: %s' % (name.upper(), error if field.text().strip() else 'a length is missing'))
        return values_m['x'], values_m['z'], values_m.get('y')

    def _lay_out(self):
        form = QtWidgets.QFormLayout(self)
        for name, label in FIELDS:
            form.addRow(label, self.fields[name])
            self.fields[name].setAccessibleName(label.replace('&', ''))
        form.addRow('&unit', self.unit_box)
        self.error_label.setWordWrap(True)
        self.error_label.setTextFormat(QtCore.Qt.RichText)
        self.hint_label.setWordWrap(True)
        form.addRow(self.error_label)
        form.addRow(self.hint_label)

    def _on_typed(self):
        self._show_hint('')
        self._show_error()
        self._timer.start()

    def _on_unit(self, _index=None):
        """Convert the fields from the previous unit to the current unit."""
        unit = self.unit_box.currentText()
        other = UNITS[1 - UNITS.index(unit)]
        for name, field in self.fields.items():
            try:
                length_m = parse_length(field.text(), other)
            except ValueError:
                continue  # incomplete text is kept
            field.setText(_text_of(length_m, unit))
        self._show_error()
        self._timer.start()

    def _on_enter(self):
        try:
            position = self.read()
        except ValueError as error:
            self.show_problem(str(error))
            self.fields[str(error)[0].lower()].setFocus()
            return
        self._timer.stop()
        self.entered.emit(*position)

    def _show_error(self):
        error_m = truth_m = None
        with contextlib.suppress(ValueError):  # no complete position yet
            x_m, z_m, _y_m = self.read()
            truth_m = x_m, z_m
            if self._estimate_m is not None:
                error_m = float(self._estimate_m[0]) - x_m, float(self._estimate_m[2]) - z_m
        self.error_label.setText(error_text(error_m))
        self.previewed.emit(truth_m)

    def _show_hint(self, text, style=''):
        self.hint_label.setStyleSheet(style)
        self.hint_label.setText(text)


def error_text(error_m):
    """Text of errors (x, z) in metres, or of None."""
    if error_m is None:
        return 'Error: –'
    axes = 'X %+.0f mm, Z %+.0f mm' % (1000 * error_m[0], 1000 * error_m[1])
    return 'Error: <b>%s</b>, %.0f mm on the floor' % (axes.replace('-', '−'), 1000 * math.hypot(*error_m[:2]))


def _text_of(length_m, unit):
    return '' if length_m is None else '%.10g' % round(length_m / METRES[unit], 6)
