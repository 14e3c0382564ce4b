"""Actions of the window with their keyboard shortcuts, in menus."""
from ros_3d_bb_annotator.qt import QtGui

LINE = ()
MENUS = (  # of entries: method that it calls, text, and shortcuts
    ('&File', (
        ('ask_session', '&Open a session…', 'Ctrl+O'),
        LINE,
        ('ask_export', '&Export CSV…', 'Ctrl+E'),
        ('analyse', '&Analyse the noise…', 'Ctrl+Shift+A'),
        LINE,
        ('close', '&Quit', 'Ctrl+Q'))),
    ('&Edit', (
        ('undo', '&Undo', 'Ctrl+Z'),
        ('redo', '&Redo', 'Ctrl+Shift+Z', 'Ctrl+Y'),
        LINE,
        ('same_as_last', '&Same as last', 'Ctrl+L'),
        ('enter_for_label', 'Enter for &all of this label', 'Ctrl+Shift+L'),
        ('clear_truth', '&Clear the true position', 'Ctrl+Shift+T'),
        ('ask_reject', 'Re&ject…', 'Ctrl+R'),
        ('restore', 'Res&tore', 'Ctrl+Shift+R'),
        LINE,
        ('delete_box', 'D&elete the box', 'Del', 'Ctrl+Shift+D'),
        LINE,
        ('edit_marks', '&Floor marks…', 'Ctrl+G'))),
    ('&Go', (
        ('next', '&Next measurement', 'PgDown'),
        ('previous', '&Previous measurement', 'PgUp'),
        ('next_new', 'Next measurement to &do', 'Ctrl+N'),
        ('next_implausible', 'Next &implausible position', 'Ctrl+I'),
        LINE,
        ('begin', 'Focus the &true position', 'F4'))),
    ('&Person', tuple(
        ('choose_%d' % number, 'Box &%d' % number, '%d' % number, 'Alt+%d' % number)
        for number in range(1, 10))),
    ('&View', (
        ('fit', '&Whole image', '0', 'Ctrl+0'),)))


def build_menus(window):
    """Fill the menu bar of a window. Returns {name: QAction}."""
    actions = {}
    for title, entries in MENUS:
        menu = window.menuBar().addMenu(title)
        for entry in entries:
            if entry == LINE:
                menu.addSeparator()
                continue
            name, text, *keys = entry
            action = menu.addAction(text)
            action.setShortcuts([QtGui.QKeySequence(key) for key in keys])
            action.setToolTip('%s (%s)' % (_plain(text), ', '.join(keys)))
            action.setIconText(_plain(text).replace('Enter for all', 'All'))  # of buttons
            action.triggered.connect(lambda _checked, call=window.handler(name): call())
            actions[name] = action
    return actions


def _plain(text):
    return text.replace('&', '').rstrip('…')
