"""Fields for the truth of a measurement, and the resulting error."""
import math

from ros_3d_bb_annotator.lengths import length_text, parse_length
from ros_3d_bb_annotator.qt import QtCore, QtGui, QtWidgets, Signal

FIELDS = (('x', '&X (right)'), ('z', '&Z (ahead)'), ('y', '&Y (down)'))
WARNING = '#a04000'


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
    """Panel of the truth: (x_m, y_m or None, z_m).

    Signals: `entered` when Enter is pressed on a complete position; `previewed` with the current one, or None.
    """

    entered = Signal(object)
    previewed = Signal(object)

    def __init__(self, parent=None):
        super(TruthPanel, self).__init__('True position, mm', parent)
        self.fields = {name: LengthEdit() for name, _label in FIELDS}
        self.error_label, self.hint_label = QtWidgets.QLabel(), QtWidgets.QLabel()
        self._is_typed = False
        self._lay_out()
        for field in self.fields.values():
            field.textEdited.connect(self._on_typed)
            field.returnPressed.connect(self._on_enter)

    def show_truth(self, truth_m, offered, keep_typed):
        """Show the truth (x, y, z) of a person or None, or else the position of an offered Mark.

        With `keep_typed`, text that was typed but not entered remains.
        """
        hint = ''
        if truth_m is None and offered is not None:
            truth_m = offered.x_m, None, offered.z_m
            hint = 'Mark %s: press Enter to accept it' % offered.name
        if not (keep_typed and self._is_typed):
            self._is_typed = False
            for name, value_m in zip('xyz', truth_m or (None,) * 3):
                self.fields[name].setText('' if value_m is None else '%.10g' % round(1000 * value_m, 6))
            self._show_hint(hint)
        self.preview()

    def forget_typed(self):
        """Show the truth next time instead of the typed text."""
        self._is_typed = False

    def begin(self):
        self.fields['x'].setFocus()
        self.fields['x'].selectAll()

    def has_keyboard(self):
        return any(field.hasFocus() for field in self.fields.values())

    def show_problem(self, text):
        self._show_hint(text, 'color: %s; font-weight: bold' % WARNING)

    def read(self):
        """Return the typed position. Raises ValueError with the name of the invalid field."""
        values_m = {}
        for name, field in self.fields.items():
            if name == 'y' and not field.text().strip():
                continue
            try:
                values_m[name] = parse_length(field.text())
            except ValueError as error:
                raise ValueError('%s: %s' % (name.upper(), error if field.text().strip() else 'a length is missing'))
        return values_m['x'], values_m.get('y'), values_m['z']

    def _lay_out(self):
        form = QtWidgets.QFormLayout(self)
        for name, label in FIELDS:
            form.addRow(label, self.fields[name])
            self.fields[name].setMinimumWidth(60)
            self.fields[name].setAccessibleName(label.replace('&', ''))
        self.fields['y'].setPlaceholderText('optional')
        self.error_label.setWordWrap(True)
        self.error_label.setTextFormat(QtCore.Qt.RichText)
        self.hint_label.setWordWrap(True)
        form.addRow(self.error_label)
        form.addRow(self.hint_label)

    def _on_typed(self):
        self._is_typed = True
        self._show_hint('')
        self.preview()

    def _on_enter(self):
        try:
            truth_m = self.read()
        except ValueError as error:
            self.show_problem(str(error))
            self.fields[str(error)[0].lower()].setFocus()
            return
        self.entered.emit(truth_m)

    def preview(self):
        try:
            truth_m = self.read()
        except ValueError:  # no complete position yet
            truth_m = None
        self.previewed.emit(truth_m)

    def show_error(self, error_text, warning):
        """Show the error of the typed position, and a warning about it or an empty text."""
        self.error_label.setText(error_text)
        if warning:
            self.show_problem(warning)

    def _show_hint(self, text, style=''):
        self.hint_label.setStyleSheet(style)
        self.hint_label.setText(text)


def error_text(error_m):
    """Text of errors (x, z) in metres, or of None."""
    if error_m is None:
        return 'Error: –'
    return 'Error: <b>X %s, Z %s</b>, distance %s' % (
        length_text(error_m[0], True), length_text(error_m[1], True), length_text(math.hypot(*error_m[:2])))
