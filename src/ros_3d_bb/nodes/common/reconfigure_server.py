"""Server for changing the parameters of a running node with the dynamic_reconfigure tools."""
import threading

import rospy
from dynamic_reconfigure.encoding import decode_config, encode_config, get_tree
from dynamic_reconfigure.msg import Config, ConfigDescription, Group, ParamDescription
from dynamic_reconfigure.srv import Reconfigure, ReconfigureResponse

from ros_3d_bb.core.params import params_from, table_of
from ros_3d_bb.nodes.common.startup import stored_params

TYPES = {bool: 'bool', int: 'int', float: 'double', str: 'str', tuple: 'str'}  # the protocol has no lists


class ReconfigureServer(object):
    """Accept changes of the parameters that are marked as live in the table (see `ros_3d_bb.core.params.Param`).

    The description, for which dynamic_reconfigure generates code, is built from that table. A request with an invalid
    value is rejected as a whole, where the server of dynamic_reconfigure would clamp the value. The response contains
    the current values, because an error would end the thread of rqt_reconfigure.

    `params` are all parameters of the node, as returned by `startup.read_params`. `apply` is called with the changed
    parameters, in the same order. It raises ValueError without changing anything if they are invalid. `namespace` is
    that of the node, see `startup.Part`.

    Publishes
    ---------
    ~parameter_descriptions : dynamic_reconfigure/ConfigDescription
        Parameters that can be changed at run time and their limits; latched.
    ~parameter_updates : dynamic_reconfigure/Config
        Current values; latched.

    Services
    --------
    ~set_parameters : dynamic_reconfigure/Reconfigure
        Changes the parameters that are marked Live, as used by rqt_reconfigure.
    """

    def __init__(self, params, apply, namespace='~'):
        self._params, self._apply, self._lock = list(params), apply, threading.Lock()
        self._namespace = namespace
        self._live = live_in(type(each) for each in params)
        description = _description_of(self._live)
        self._groups = get_tree(description)
        descriptions_pub = rospy.Publisher(namespace + 'parameter_descriptions', ConfigDescription, queue_size=1,
                                           latch=True)
        self._updates_pub = rospy.Publisher(namespace + 'parameter_updates', Config, queue_size=1, latch=True)
        self._store_changes(stored_params(namespace))
        descriptions_pub.publish(description)
        self._updates_pub.publish(self._message())
        rospy.Service(namespace + 'set_parameters', Reconfigure, self._on_request)

    def _on_request(self, request):
        with self._lock:
            before = self._values()
            try:
                self._change(decode_config(request.config))
            except ValueError as error:
                rospy.logwarn('parameter change rejected: %s; all parameters keep their values', error)
            for name in self._store_changes(before):
                rospy.loginfo('~%s changed from %s to %s', name, before[name], self._values()[name])
            message = self._message()
            self._updates_pub.publish(message)  # also if nothing changed, to reset the sliders
            return ReconfigureResponse(message)

    def _change(self, given):
        for name in sorted(set(given) & set(self._values()) - set(self._live)):
            raise ValueError('parameter ~%s is read only at startup; parameters that can be changed: %s'
                             % (name, ', '.join(sorted(self._live))))
        params = params_from(dict(self._values(), **given), *(type(each) for each in self._params))
        self._apply(*params)
        self._params = params

    def _values(self):
        return {name: list(value) if isinstance(value, tuple) else value
                for each in self._params for name, value in each._asdict().items()}

    def _store_changes(self, known):
        values = self._values()
        changed = [name for name in self._live if name not in known or known[name] != values[name]]
        for name in changed:
            rospy.set_param(self._namespace + name, values[name])
        return changed

    def _message(self):
        values = self._values()
        return encode_config(dict({name: _plain(values[name]) for name in self._live}, groups=self._groups))


def live_in(kinds):
    return {name: param for name, param in table_of(kinds).items() if param.live}


def _description_of(live):
    """Return the ConfigDescription of live parameters, with a group for each section."""
    groups = []
    for section in [''] + sorted(set(param.section for param in live.values()) - {''}):
        described = [ParamDescription(name, TYPES[type(param.default)], 0, param.text + ' ' + param.facts,
                                      _choices_of(param))
                     for name, param in live.items() if param.section == section]
        groups.append(Group(name=section or 'Default', parameters=described, id=len(groups)))
    limits = {name: _slider(param) for name, param in live.items()}
    return ConfigDescription(groups=groups, min=encode_config({name: low for name, (low, _high) in limits.items()}),
                             max=encode_config({name: high for name, (_low, high) in limits.items()}),
                             dflt=encode_config({name: _plain(param.default) for name, param in live.items()}))


def _plain(value):
    return ', '.join(map(str, value)) if isinstance(value, (list, tuple)) else value


def _slider(param):
    kind = type(param.default)
    if kind is bool:
        return False, True
    return (kind(param.live[0]), kind(param.live[1])) if kind in (int, float) else ('', '')


def _choices_of(param):
    """Return the choices as the text of a Python dictionary, as the protocol requires; empty without choices."""
    if not param.choices or not isinstance(param.default, str):
        return ''
    words = [{'name': word, 'type': 'str', 'value': word, 'description': ''} for word in param.choices]
    return repr({'enum': words, 'enum_description': param.text})
