"""Actions of the window with their keyboard shortcuts: menus, and the overview of keys."""
from typing import NamedTuple, Tuple

from ros_3d_bb_annotator.qt import QtGui, QtWidgets


class Action(NamedTuple):
    """Menu entry: method that it calls, text, shortcuts, and the initial state of a checkable action or None."""

    name: str
    text: str
    keys: Tuple[str, ...] = ()
    checked: object = None


LINE = Action('', '')
MENUS = (
    ('&File', (
        Action('ask_session', '&Open a session…', ('Ctrl+O',)),
        Action('reload', '&Reload', ('F5',)),
        LINE,
        Action('ask_export', '&Export CSV…', ('Ctrl+E',)),
        Action('analyse', '&Analyse the noise…', ('Ctrl+Shift+A',)),
        LINE,
        Action('close', '&Quit', ('Ctrl+Q',)))),
    ('&Edit', (
        Action('undo', '&Undo', ('Ctrl+Z',)),
        Action('redo', '&Redo', ('Ctrl+Shift+Z', 'Ctrl+Y')),
        LINE,
        Action('same_as_last', '&Same as last', ('Ctrl+L',)),
        Action('enter_for_label', 'Enter for &all of this label', ('Ctrl+Shift+L',)),
        Action('clear_truth', '&Clear the true position', ('Ctrl+Shift+T',)),
        Action('ask_reject', 'Re&ject…', ('Ctrl+R',)),
        Action('restore', 'Res&tore', ('Ctrl+Shift+R',)),
        LINE,
        Action('start_drawing', '&Draw a box', ('D', 'Ctrl+D')),
        Action('edit_box', 'Move or resize the &box', ('B', 'Ctrl+B')),
        Action('delete_box', 'D&elete the box', ('Del', 'Ctrl+Shift+D')),
        LINE,
        Action('edit_marks', '&Floor marks…', ('Ctrl+G',)))),
    ('&Go', (
        Action('next', '&Next measurement', ('PgDown',)),
        Action('previous', '&Previous measurement', ('PgUp',)),
        Action('next_new', 'Next measurement to &do', ('Ctrl+N',)),
        Action('next_implausible', 'Next &implausible position', ('Ctrl+I',)),
        Action('first', '&First measurement', ('Alt+Home',)),
        Action('last', '&Last measurement', ('Alt+End',)),
        LINE,
        Action('go_to_list', 'Focus the li&st', ('F2',)),
        Action('go_to_search', 'Sear&ch the list', ('Ctrl+F',)),
        Action('go_to_image', 'Focus the i&mage', ('F3',)),
        Action('go_to_truth', 'Focus the &true position', ('F4',)),
        Action('go_to_floor', 'Focus the fl&oor', ('F6',)),
        LINE,
        Action('go_on', '&Advance to the next measurement after an entry', ('Ctrl+T',), True))),
    ('&Person', tuple(
        Action('choose_%d' % number, 'Box &%d' % number, ('%d' % number, 'Alt+%d' % number))
        for number in range(1, 10))),
    ('&View', (
        Action('zoom_in', 'Zoom &in', ('+', '=', 'Ctrl++', 'Ctrl+=')),
        Action('zoom_out', 'Zoom &out', ('-', 'Ctrl+-')),
        Action('fit', '&Whole image', ('0', 'Ctrl+0')),
        Action('show_samples', '&Samples', ('P', 'Ctrl+P'), True))),
    ('&Help', (
        Action('show_keys', '&Keys', ('F1',)),)))
OTHER_KEYS = (
    ('The image has the keyboard focus (F3, or a click)', (
        ('arrows', 'move the cursor by 10 pixels; with Ctrl by one'),
        ('Shift + arrows', 'move the part of the image that is shown'),
        ('Space', 'set the first corner of a box at the cursor, then the second one'),
        ('B, then arrows', 'move the box; with Shift its lower right corner, with Ctrl by one pixel; Enter accepts'),
        ('Esc', 'cancel the box that is being drawn or edited'),
        ('wheel, drag', 'zoom, move; a click selects a box'),
        ('Shift + drag', 'draw a box'),
        ('drag an edge', 'resize the selected box; Ctrl + drag moves it'))),
    ('The floor has the keyboard focus (F6)', (
        ('arrows', 'go from mark to mark'),
        ('Enter, Space', 'enter the position of the mark'))),
    ('The list has the keyboard focus (F2)', (
        ('Shift + arrows', 'select several measurements: truth and rejection are entered for all of them'),)),
    ('A field of the true position has the keyboard focus (F4)', (
        ('Enter', 'enter the position and advance to the next measurement'),
        ('Tab', 'next field'))))


def build_menus(window):
    """Fill the menu bar of a window. Returns {name: QAction}."""
    actions = {}
    for title, entries in MENUS:
        menu = window.menuBar().addMenu(title)
        for entry in entries:
            if entry == LINE:
                menu.addSeparator()
                continue
            action = menu.addAction(entry.text)
            action.setShortcuts([QtGui.QKeySequence(key) for key in entry.keys])
            action.setToolTip('%s (%s)' % (_plain(entry.text), ', '.join(entry.keys)))
            action.setIconText(_plain(entry.text).replace('Enter for all', 'All'))  # of buttons
            if entry.checked is not None:
                action.setCheckable(True)
                action.setChecked(entry.checked)
            else:
                action.triggered.connect(lambda _checked, call=window.handler(entry.name): call())
            actions[entry.name] = action
    return actions


def keys_dialog(parent):
    dialog = QtWidgets.QDialog(parent)
    dialog.setWindowTitle('Keys')
    dialog.resize(620, 640)
    text = QtWidgets.QTextBrowser()
    text.setHtml(_overview())
    buttons = QtWidgets.QDialogButtonBox(QtWidgets.QDialogButtonBox.Close)
    buttons.rejected.connect(dialog.reject)
    layout = QtWidgets.QVBoxLayout(dialog)
    layout.addWidget(text)
    layout.addWidget(buttons)
    return dialog


def _overview():
    """Overview of keys as HTML, generated from the menus."""
    sections = [(_plain(title), [(', '.join(entry.keys), _plain(entry.text)) for entry in entries if entry != LINE])
                for title, entries in MENUS] + list(OTHER_KEYS)
    rows = ''.join('<tr><td colspan="2"><br><b>%s</b></td></tr>' % title
                   + ''.join('<tr><td>%s&nbsp;&nbsp;&nbsp;</td><td>%s</td></tr>' % row for row in lines)
                   for title, lines in sections)
    return '<p>In a field, digits are text; Alt and a digit selects a box there.</p><table>%s</table>' % rows


def _plain(text):
    return text.replace('&', '').rstrip('…')
