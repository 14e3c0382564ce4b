"""Sphinx: README, doc/, config/ and changelog as a site. `./run doc` builds it; nothing is fetched from a network.

The root of the repository is the folder of the sources, so that Sphinx checks every link between pages, and to files.
"""
import os
import re

from docutils import nodes
from latex2mathml.converter import convert

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
LINK = re.compile(r'\[([^\]]*)\]\(([^)\s#]+)\)')

project = 'ros_3d_bb'
author = 'ros_3d_bb developers'
with open(os.path.join(ROOT, 'package.xml'), encoding='utf-8') as _stream:
    version = re.search('<version>(.*)</version>', _stream.read()).group(1)
root_doc, CONTENTS = 'README', 'doc/index'
source_suffix = {'.md': 'markdown', '.rst': 'restructuredtext'}
include_patterns = ['*.md', 'CHANGELOG.rst', '.github/SUPPORT.md', 'doc/**', 'config/**']
FOLDERS = {'config': 'doc/nodes/index.md'}
extensions = ['myst_parser']
myst_enable_extensions = ['dollarmath']
highlight_language = 'none'
myst_heading_anchors = 3  # links to #headings are those of the repository's own pages
html_theme = 'alabaster'
html_static_path, html_css_files, html_js_files = ['static'], ['style.css'], ['site.js']
html_title, html_favicon = '%s %s' % (project, version), os.path.join(ROOT, 'doc', 'static', 'favicon.svg')
html_theme_options = {'page_width': '1200px', 'body_max_width': '1000px', 'sidebar_width': '240px',
                      'code_font_size': '0.75em', 'description': 'People in 3D for a ROS 1 robot, version ' + version,
                      'font_family': 'DejaVu Sans, sans-serif'}
html_sidebars = {'**': ['about.html', 'searchbox.html', 'navigation.html']}
html_show_sphinx = html_show_copyright = html_copy_source = False
html_math_renderer = 'mathml'


def _navigation():
    """The sections of the contents as Sphinx's navigation: captions, and the links of the sections."""
    with open(os.path.join(ROOT, CONTENTS + '.md'), encoding='utf-8') as stream:
        sections = stream.read().split('\n## ')[1:]
    captions = [('Contents', [('All pages', 'index.md')])]
    for section in sections:
        links = [link.groups() for link in LINK.finditer(section)]
        captions.append((section.splitlines()[0], [
            (text, path) for text, path in links if path != '../README.md' and path.endswith(('.md', '.rst'))]))
    names = set(os.path.splitext(name)[0] for name in os.listdir(os.path.join(ROOT, 'doc', 'nodes'))) - {'index'}
    captions.append(('Nodes', [('All nodes', 'nodes/index.md')] + [
        (name, 'nodes/%s.md' % name) for name in sorted(names)]))
    return [(caption, ['%s </%s>' % (text, os.path.splitext(os.path.normpath(os.path.join('doc', path)))[0])
                       for text, path in links]) for caption, links in captions]


def _prepare(_app, name, source):
    """Tell Sphinx the navigation, and lead links to folders to the generated pages; other folders are words only."""
    here = os.path.dirname(os.path.join(ROOT, name))

    def linked(link):
        folder = os.path.join(here, link.group(2))
        if not os.path.isdir(folder):
            return link.group()
        page = FOLDERS.get(os.path.relpath(folder, ROOT))
        return '[%s](%s)' % (link.group(1), os.path.relpath(os.path.join(ROOT, page), here)) if page else link.group(1)

    source[0] = LINK.sub(linked, source[0])
    if name == root_doc:
        for caption, pages in _navigation():
            source[0] += '\n```{toctree}\n:hidden:\n:caption: %s\n\n%s\n```\n' % (caption, '\n'.join(pages))


def _write_first_page(app, _exception):
    with open(os.path.join(app.outdir, 'index.html'), 'w') as stream:
        stream.write('<!DOCTYPE html><title>%s</title><meta http-equiv="refresh" content="0; url=%s.html">\n'
                     % (project, root_doc))


def _write_inline(self, node):
    self.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _write_block(self, node):
    self.body.append('<div class="math" style="margin: 1em 0">%s</div>' % convert(node.astext(), display='block'))
    raise nodes.SkipNode


def setup(app):
    """Formulas as MathML, which browsers show without a script."""
    app.connect('source-read', _prepare)
    app.connect('build-finished', _write_first_page)
    app.add_html_math_renderer('mathml', (_write_inline, None), (_write_block, None))
