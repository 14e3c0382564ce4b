"""Fields for the truth of a measurement, and the resulting error."""
import math

from ros_3d_bb_annotator.lengths import METRES, length_text, parse_length
from ros_3d_bb_annotator.qt import QtCore, QtGui, QtWidgets, Signal

FIELDS = (('x', '&X (right)'), ('z', '&Z (ahead)'), ('y', '&Y (down)'))
WARNING = '#a04000'
UNITS = ('mm', 'm')
TYPING_MS = 300  # typed text is kept after a pause of this length


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
    of the fields to be saved; `previewed` with the current (x_m, y_m or None, z_m), or None if incomplete;
    `unit_changed` when `unit` is another one.
    """

    entered = Signal(float, float, object)
    typed = Signal(dict)
    previewed = Signal(object)
    unit_changed = Signal()

    def __init__(self, parent=None):
        super(TruthPanel, self).__init__('True position', parent)
        self.fields = {name: LengthEdit() for name, _label in FIELDS}
        self.unit_box = QtWidgets.QComboBox()
        self.unit_box.addItems(UNITS)
        self.error_label, self.hint_label = QtWidgets.QLabel(), QtWidgets.QLabel()
        self._stored = self.texts()
        self._timer = QtCore.QTimer(self, singleShot=True, interval=TYPING_MS)
        self._timer.timeout.connect(self.flush)
        self._lay_out()
        for field in self.fields.values():
            field.textEdited.connect(self._on_typed)
            field.returnPressed.connect(self._on_enter)
        self.unit_box.activated.connect(self._on_unit)

    @property
    def unit(self):
        return self.unit_box.currentText()

    def show_truth(self, truth_m, draft, offered=None):
        """Show the truth (x, y, z) of a person or None, or its draft, or else the position of an offered Mark."""
        self._timer.stop()
        if draft.get('unit', self.unit) != self.unit and draft['unit'] in UNITS:
            self.unit_box.setCurrentText(draft['unit'])
            self.unit_changed.emit()
        hint = 'Typed, but not entered yet: press Enter' if draft else ''
        if truth_m is None and offered is not None:
            truth_m = offered.x_m, None, offered.z_m
            hint = hint or 'Mark %s: press Enter to accept it' % offered.name
        self._stored = {name: _text_of(value_m, self.unit) for name, value_m in zip('xyz', truth_m or (None,) * 3)}
        for name, field in self.fields.items():
            field.setText(draft.get(name, '' if draft else self._stored[name]))
        self._show_hint(hint)
        self.preview()

    def texts(self):
        """Text of the fields and the unit: {name: text}."""
        return dict({name: field.text() for name, field in self.fields.items()}, unit=self.unit)

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
        self._show_hint(text, 'color: %s; font-weight: bold' % WARNING)

    def read(self):
        """Return (x_m, z_m, y_m or None). Raises ValueError with the name of the invalid field."""
        values_m = {}
        for name, field in self.fields.items():
            if name == 'y' and not field.text().strip():
                continue
            try:
                values_m[name] = parse_length(field.text(), self.unit)
            except ValueError as error:
                raise ValueError('%s: %s' % (name.upper(), error if field.text().strip() else 'a length is missing'))
        return values_m['x'], values_m['z'], values_m.get('y')

    def _lay_out(self):
        form = QtWidgets.QFormLayout(self)
        for name, label in FIELDS:
            form.addRow(label, self.fields[name])
            self.fields[name].setMinimumWidth(60)
            self.fields[name].setAccessibleName(label.replace('&', ''))
        self.fields['y'].setPlaceholderText('optional')
        form.addRow('&Unit', self.unit_box)
        self.error_label.setWordWrap(True)
        self.error_label.setTextFormat(QtCore.Qt.RichText)
        self.hint_label.setWordWrap(True)
        form.addRow(self.error_label)
        form.addRow(self.hint_label)

    def _on_typed(self):
        self._show_hint('')
        self.preview()
        self._timer.start()

    def _on_unit(self, _index=None):
        """Convert the fields from the previous unit to the current unit."""
        unit = self.unit
        other = UNITS[1 - UNITS.index(unit)]
        for name, field in self.fields.items():
            try:
                length_m = parse_length(field.text(), other)
            except ValueError:
                continue  # incomplete text is kept
            field.setText(_text_of(length_m, unit))
        self.unit_changed.emit()
        self.preview()
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

    def preview(self):
        """Emit `previewed`."""
        try:
            x_m, z_m, y_m = self.read()
        except ValueError:  # no complete position yet
            self.previewed.emit(None)
            return
        self.previewed.emit((x_m, y_m, z_m))

    def show_error(self, error_text, warning):
        """Show the error of the typed position, and a warning about it or an empty text."""
        self.error_label.setText(error_text)
        if warning:
            self.show_problem(warning)

    def _show_hint(self, text, style=''):
        self.hint_label.setStyleSheet(style)
        self.hint_label.setText(text)


def error_text(error_m, unit):
    """Text of errors (x, z) in metres, or of None."""
    if error_m is None:
        return 'Error: –'
    return 'Error: <b>X %s, Z %s</b>, distance %s' % (
        length_text(error_m[0], unit, True), length_text(error_m[1], unit, True),
        length_text(math.hypot(*error_m[:2]), unit))


def _text_of(length_m, unit):
    return '' if length_m is None else '%.10g' % round(length_m / METRES[unit], 6)
