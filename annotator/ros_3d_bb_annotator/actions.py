"""Actions of the window with their keyboard shortcuts, in menus."""
from typing import NamedTuple, Tuple

from ros_3d_bb_annotator.qt import QtGui


class Action(NamedTuple):
    """Menu entry: method that it calls, text, and shortcuts."""

    name: str
    text: str
    keys: Tuple[str, ...] = ()


LINE = Action('', '')
MENUS = (
    ('&File', (
        Action('ask_session', '&Open a session…', ('Ctrl+O',)),
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
        Action('delete_box', 'D&elete the box', ('Del', 'Ctrl+Shift+D')),
        LINE,
        Action('edit_marks', '&Floor marks…', ('Ctrl+G',)))),
    ('&Go', (
        Action('next', '&Next measurement', ('PgDown',)),
        Action('previous', '&Previous measurement', ('PgUp',)),
        Action('next_new', 'Next measurement to &do', ('Ctrl+N',)),
        Action('next_implausible', 'Next &implausible position', ('Ctrl+I',)),
        LINE,
        Action('go_to_truth', 'Focus the &true position', ('F4',)))),
    ('&Person', tuple(
        Action('choose_%d' % number, 'Box &%d' % number, ('%d' % number, 'Alt+%d' % number))
        for number in range(1, 10))),
    ('&View', (
        Action('fit', '&Whole image', ('0', 'Ctrl+0')),)))


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
            action.triggered.connect(lambda _checked, call=window.handler(entry.name): call())
            actions[entry.name] = action
    return actions


def _plain(text):
    return text.replace('&', '').rstrip('…')
