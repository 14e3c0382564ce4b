"""Server for changing the parameters of a running node with the dynamic_reconfigure tools."""
import threading

import rospy
from dynamic_reconfigure.encoding import decode_config, encode_config, encode_description, get_tree
from dynamic_reconfigure.msg import Config, ConfigDescription
from dynamic_reconfigure.srv import Reconfigure, ReconfigureResponse

from ros_3d_bb.core.params import params_from
from ros_3d_bb.nodes.common.live_parameters import description_of, live_in, plain_values
from ros_3d_bb.nodes.common.master_registration import on_new_master


class ReconfigureServer(object):
    """Accept changes of the parameters that are marked as live in the table (see `ros_3d_bb.core.params.Param`).

    The description, for which dynamic_reconfigure generates code, is built from that table. A request with an invalid
    value is rejected as a whole, where the server of dynamic_reconfigure would clamp the value. The response contains
    the current values, because an error would end the thread of rqt_reconfigure.

    Parameters
    ----------
    params : list of NamedTuple
        All parameters of the node, as returned by `startup.read_params`.
    take : callable
        Called with the changed parameters, in the same order. Raises ValueError without changing anything if they are
        invalid.

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

    def __init__(self, params, take):
        self._params, self._take, self._lock = list(params), take, threading.Lock()
        kinds = [type(each) for each in params]
        self._names = list(live_in(kinds))
        description = encode_description(description_of(kinds))
        self._groups = get_tree(description)
        self._descriptions_pub, self._updates_pub = (
            rospy.Publisher('~parameter_' + name, kind, queue_size=1, latch=True)
            for name, kind in (('descriptions', ConfigDescription), ('updates', Config)))
        self._keep_in_step(rospy.get_param('~', {}))
        self._descriptions_pub.publish(description)
        self._updates_pub.publish(self._message())
        rospy.Service('~set_parameters', Reconfigure, self._on_request)
        on_new_master(lambda: self._keep_in_step({}))

    def _on_request(self, request):
        with self._lock:
            before = self._values()
            try:
                self._change(decode_config(request.config))
            except ValueError as error:
                rospy.logwarn('parameter change rejected: %s; all stay as they are', error)
            for name in self._keep_in_step(before):
                rospy.loginfo('~%s is %s now, %s before', name, self._values()[name], before[name])
            message = self._message()
            self._updates_pub.publish(message)  # also if nothing changed, to reset the sliders
            return ReconfigureResponse(message)

    def _change(self, given):
        for name in sorted(set(given) & set(self._values()) - set(self._names)):
            raise ValueError('parameter ~%s is read at the start only; those that can be changed: %s'
                             % (name, ', '.join(sorted(self._names))))
        params = params_from(dict(self._values(), **given), *(type(each) for each in self._params))
        self._take(*params)
        self._params = params

    def _values(self):
        """Return {name: value} in the types of the parameter server, with lists instead of tuples."""
        return {name: list(value) if isinstance(value, tuple) else value
                for each in self._params for name, value in each._asdict().items()}

    def _keep_in_step(self, known):
        """Set the live parameters that differ from `known` on the parameter server. Returns their names."""
        values = self._values()
        changed = [name for name in self._names if name not in known or known[name] != values[name]]
        for name in changed:
            rospy.set_param('~' + name, values[name])
        return changed

    def _message(self):
        """Return the current values as a Config message."""
        values = plain_values(self._params)
        return encode_config(dict({name: values[name] for name in self._names}, groups=self._groups))
