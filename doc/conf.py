"""Sphinx: these pages as a site. `./run doc` builds it; nothing is fetched from a network, now or when it is read."""
import glob
import os
import re

from docutils import nodes
from latex2mathml.converter import convert

HERE = os.path.dirname(os.path.abspath(__file__))
FIRST = ['architecture', 'frames_and_time', 'error_model', 'tracking', 'session', 'decisions', 'glossary',
         'launch_files']
OUTSIDE = re.compile(r'\[([^\]]*)\]\((?:\.\./)+[^)\s]*\.md(?:#[^)\s]*)?\)')  # pages that are not on the site

project = 'ros_3d_bb'
author = 'ros_3d_bb developers'
extensions = ['myst_parser']
myst_enable_extensions = ['dollarmath']
highlight_language = 'none'
myst_heading_anchors = 3  # links to #headings are those of the repository's own pages
html_theme = 'alabaster'
html_theme_options = {'page_width': '1200px', 'body_max_width': '900px', 'sidebar_width': '240px',
                      'code_font_size': '0.8em', 'description': 'People in 3D for a ROS 1 robot',
                      'font_family': 'DejaVu Sans, sans-serif'}
html_sidebars = {'**': ['about.html', 'navigation.html', 'searchbox.html']}
html_show_sphinx = html_show_copyright = html_copy_source = False
html_math_renderer = 'mathml'


def _names(folder):
    """The pages in a folder, as Sphinx names them."""
    names = [os.path.relpath(path, HERE)[:-len('.md')] for path in glob.glob(os.path.join(HERE, folder, '*.md'))]
    return sorted(names, key=lambda name: (not name.endswith('index'), name))


def _prepare(_app, name, source):
    """Tell Sphinx the order of the pages, and keep only the words of links to pages that are not on the site."""
    source[0] = OUTSIDE.sub(r'\1', source[0])
    if name == 'index':
        others = [other for other in _names('') if other not in FIRST + ['index']]
        for caption, names in (('How it works', FIRST), ('More', others), ('Nodes', _names('nodes'))):
            source[0] += '\n```{toctree}\n:hidden:\n:caption: %s\n\n%s\n```\n' % (caption, '\n'.join(names))


def _write_inline(self, node):
    self.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _write_block(self, node):
    self.body.append('<div class="math" style="margin: 1em 0">%s</div>' % convert(node.astext(), display='block'))
    raise nodes.SkipNode


def setup(app):
    """Formulas as MathML, which browsers show without a script."""
    app.connect('source-read', _prepare)
    app.add_html_math_renderer('mathml', (_write_inline, None), (_write_block, None))
