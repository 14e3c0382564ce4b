"""Write the pages of the nodes (doc/nodes), of the launch files (doc/launch_files.md), and config/*.yaml from the code.

`./run doc` does it; in a sourced workspace: python3 doc/node_pages.py
Sources are the docstrings of a node's class and of the classes in ros_3d_bb.nodes that it uses, the tables of its
parameters (`ros_3d_bb.params.Param`), and its launch file. A topic, a parameter or an argument is described there.
"""
import ast
import glob
import importlib
import inspect
import os
import re
import sys
import textwrap
import xml.etree.ElementTree as ElementTree
from typing import NamedTuple

from ros_3d_bb.params import SET_BY_LAUNCH, table_of

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
MADE = '<!-- Made by doc/node_pages.py from the code. Change that, and run: ./run doc -->'
MADE_CONFIG = 'Made by ./run doc from the table in the code.'
LIVE = (' Those marked Live can be changed while the node runs,\n# as with rqt_reconfigure; the range is that of its '
        'sliders.')
SECTIONS = 'Subscribes', 'Publishes', 'Services', 'Calls'
SERVICES = 'Services', 'Calls'


class Entry(NamedTuple):
    """A topic or a service as a docstring describes it."""

    name: str
    kind: str
    meaning: str


class Node(NamedTuple):
    """A node: its class and module, the first sentence and the rest of its docstring, and {section: [Entry]}."""

    name: str
    node_class: type
    summary: str
    text: str
    sections: dict


class Parameter(NamedTuple):
    """One parameter; `default` as in YAML, `facts` as of `Param`, `group`: heading in the YAML file, '' without one."""

    name: str
    kind: str
    default: str
    meaning: str
    facts: str
    group: str


class Launch(NamedTuple):
    """A launch file: its name, its first comment, [(name, default, doc)] of its arguments, and its XML."""

    name: str
    text: str
    arguments: list
    tree: ElementTree.Element


class _Comments(ElementTree.TreeBuilder):
    def comment(self, data):
        """Keep comments, which ElementTree drops (Python 3.8 has an option for it)."""
        self.start('comment', {})
        self.data(data)
        self.end('comment')


def nodes():
    """All nodes of the package, by name."""
    paths = sorted(glob.glob(os.path.join(ROOT, 'src', 'ros_3d_bb', 'nodes', '*_node.py')))
    return [node_of(os.path.basename(path)[:-len('.py')]) for path in paths]


def node_of(name):
    """The node of a module's name, with the topics and services of the classes in ros_3d_bb.nodes that it uses."""
    module = importlib.import_module('ros_3d_bb.nodes.' + name)
    classes = [value for value in vars(module).values()
               if inspect.isclass(value) and value.__module__.startswith('ros_3d_bb.nodes.')]
    node_class, = (kind for kind in classes if kind.__module__ == module.__name__ and kind.__name__.endswith('Node'))
    text, sections = split(node_class)
    for kind in classes:
        for title, entries in split(kind)[1].items() if kind is not node_class else ():
            sections.setdefault(title, []).extend(entries)
    summary, _blank, rest = text.partition('\n\n')
    return Node(name, node_class, _one_line(summary), _one_line(rest), sections)


def split(kind):
    """The docstring of a class before its sections, and {section: [Entry]}."""
    text, *parts = re.split(r'^(%s)\n-+\n' % '|'.join(SECTIONS), inspect.getdoc(kind) or '', flags=re.MULTILINE)
    return text, {title: entries_in(body) for title, body in zip(parts[::2], parts[1::2])}


def entries_in(body):
    """The entries of a section: `name : type`, and the meaning below, indented."""
    found = re.findall(r'^(\S+) : (\S+)\n((?:[ ]+.*\n?)+)', body, re.MULTILINE)
    return [Entry(name, kind, _one_line(meaning)) for name, kind, meaning in found]


def parameter_types(node_class):
    """The NamedTuple types that a node reads its parameters into, as its call of `read_params` names them."""
    module = sys.modules[node_class.__module__]
    for call in ast.walk(ast.parse(inspect.getsource(module))):
        if isinstance(call, ast.Call) and getattr(call.func, 'id', '') == 'read_params':
            return [kind for argument in call.args for kind in (
                getattr(module, argument.value.id) if isinstance(argument, ast.Starred)
                else (getattr(module, argument.id),))]
    return []


def parameters_of(node):
    """The parameters of a node by section; those that launch files set come last.

    Raises
    ------
    ValueError
        If a parameter is not described.
    """
    table = table_of(parameter_types(node.node_class))
    sections = [param.section for param in table.values()]
    return [_parameter(node, name, param) for name, param in sorted(table.items(), key=lambda item: (
        item[1].section == SET_BY_LAUNCH, sections.index(item[1].section)))]


def _parameter(node, name, param):
    meaning = launch_meaning(node.name, name) if param.section == SET_BY_LAUNCH else None
    if not (meaning or param.text):
        raise ValueError('%s: neither the table of the parameter %s nor the doc= of an argument describes it'
                         % (node.name, name))
    return Parameter(name, type(param.default).__name__.replace('tuple', 'list'), as_yaml(param.default),
                     *((meaning, '') if meaning else (param.text, param.facts)), param.section)


def as_yaml(value):
    """A default as it is written in a file in config/."""
    if isinstance(value, bool):
        return str(value).lower()
    return '[%s]' % ', '.join(value) if isinstance(value, tuple) else str(value) or "''"


def config_files():
    """{path: text} of the parameter files of nodes."""
    return {path: config_file(node) for node in nodes() for path in config_paths(node)}


def config_paths(node):
    """The files in config/ that the docstring of a node names: one or none."""
    return re.findall(r'config/\w+\.yaml', inspect.getdoc(node.node_class))


def config_file(node):
    """The file in config/ with the parameters of a node that launch files do not set, YAML."""
    given = [parameter for parameter in parameters_of(node) if parameter.group != SET_BY_LAUNCH]
    lines, group = ['# Parameters of %s. %s' % (node.name, MADE_CONFIG), '# Numbers are 0 or more where the comment '
                    'allows no others.' + LIVE * any('Live' in parameter.facts for parameter in given), ''], ''
    for parameter in given:
        if parameter.group != group:
            group = parameter.group
            lines += ['', '# --- ' + group]
        facts = ('Default: %s. %s' % (parameter.default, parameter.facts)).strip()
        whole = '%s %s' % (parameter.meaning, facts)
        for text in [whole] if len(whole) <= 118 else [parameter.meaning, facts]:
            lines += ['# ' + line for line in textwrap.wrap(text, 118, break_on_hyphens=False)]
        lines.append('%s: %s' % (parameter.name, parameter.default))
    return '\n'.join(lines) + '\n'


def launch_files():
    """The launch files, by name."""
    return [launch_of(path) for path in sorted(glob.glob(os.path.join(ROOT, 'launch', '*.launch')))]


def launch_of(path):
    """The launch file of a path."""
    tree = ElementTree.parse(path, ElementTree.XMLParser(target=_Comments())).getroot()
    arguments = [(element.get('name'), element.get('default', element.get('value')), _one_line(element.get('doc', '')))
                 for element in tree.findall('arg') if element.get('value') is None]
    return Launch(os.path.basename(path), _one_line(tree.find('comment').text), arguments, tree)


def starting(node_name):
    """The launch files in which a node is started, and its element there."""
    return [(launch, element) for launch in launch_files() for element in launch.tree.iter('node')
            if (element.get('pkg'), element.get('type')) == ('ros_3d_bb', node_name)]


def launch_meaning(node_name, parameter):
    """What the argument that sets a parameter is for; None where none does."""
    for launch, element in starting(node_name):
        for given in element.findall('param'):
            argument = re.match(r'^\$\(arg (\w+)\)$', given.get('value', ''))
            if given.get('name') == parameter and argument:
                meaning, = (doc for name, _default, doc in launch.arguments if name == argument.group(1))
                return '%s (`%s:=`)' % (meaning, argument.group(1))
    return None


def node_page(node):
    """The page of a node, Markdown."""
    parts = ['# %s' % node.name, MADE, node.summary, node.text]
    started = ['[%s](../launch_files.md#%s)' % (launch.name, launch.name.replace('.', ''))
               for launch, _element in starting(node.name)]
    parts.append('Started by %s. Names without a slash are in the namespace of the node; `~x` is `%s/x`. Launch files '
                 'rename them.' % (', '.join(started), node.name))
    for section in SECTIONS:
        if section in node.sections:
            rows = [(_code(entry.name), _type_link(entry.kind), entry.meaning) for entry in node.sections[section]]
            parts += ['## ' + section, _table(('service' if section in SERVICES else 'topic', 'type', ''), rows)]
    parts.append('## Parameters')
    group = None
    for parameter in parameters_of(node):
        if parameter.group != group:
            group = parameter.group
            parts += ['### ' + group[0].upper() + group[1:]] if group else []
            rows = []
            parts.append(rows)
        rows.append((_code('~' + parameter.name), parameter.kind, parameter.default,
                     (parameter.meaning + ' ' + parameter.facts).strip()))
    return _page(_table(('parameter', 'type', 'default', ''), part) if isinstance(part, list) else part
                 for part in parts)


def nodes_page():
    """The page that leads to those of the nodes, Markdown."""
    rows = [('[%s](%s.md)' % (node.name, node.name), node.summary) for node in nodes()]
    return _page(['# Nodes', MADE, _table(('node', ''), rows)])


def launch_page():
    """The page of all launch files, Markdown."""
    parts = ['# Launch files', MADE,
             'All are started by `roslaunch ros_3d_bb NAME.launch`. `roslaunch --ros-args ros_3d_bb NAME.launch` shows '
             'the same as is said here.']
    for launch in launch_files():
        rows = [(_code(name), 'needed' if default is None else _code(default), doc)
                for name, default, doc in launch.arguments]
        parts += ['## ' + launch.name, launch.text, _table(('argument', 'default', ''), rows)]
    return _page(parts)


def pages():
    """{path: text} of all pages and of the files in config/."""
    made = {'doc/nodes/%s.md' % node.name: node_page(node) for node in nodes()}
    return dict(made, **config_files(), **{'doc/nodes/index.md': nodes_page(), 'doc/launch_files.md': launch_page()})


def _page(parts):
    return '\n\n'.join(filter(None, parts)) + '\n'


def _table(titles, rows):
    lines = [titles, ['---'] * len(titles)] + rows
    return '\n'.join('| %s |' % ' | '.join(cell.replace('|', '\\|') for cell in line) for line in lines)


def _type_link(kind):
    package, name = kind.split('/')
    return '[%s](../../msg/%s.msg)' % (kind, name) if package == 'ros_3d_bb' else kind


def _code(text):
    return '`%s`' % text if text else 'empty'


def _one_line(text):
    return ' '.join(text.split())


def main():
    """Write the pages and the files."""
    for path, text in pages().items():
        with open(os.path.join(ROOT, path), 'w', encoding='utf-8') as stream:
            stream.write(text)


if __name__ == '__main__':
    main()
