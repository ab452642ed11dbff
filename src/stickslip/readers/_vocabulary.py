"""Words used by drive tools, robots and people for the columns of their logs."""

from __future__ import annotations


def _table(text: str) -> dict[str, tuple[str, ...]]:
    """Parse "key: word word ..." lines into a mapping; indented lines continue."""
    out: dict[str, tuple[str, ...]] = {}
    key = ""
    for word in text.split():
        if word.endswith(":"):
            key = word[:-1]
            out[key] = ()
        else:
            out[key] += (word,)
    return out


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


WORDS = _table(
    """
    time: time zeit timestamp zeitstempel datetime uhrzeit elapsed seconds clock stamp temps tempo tiempo
    position: position positions pos angle winkel lage weg displacement deflection theta phi posn encoder enc
        resolver lageist lagesoll stellung rotation stroke hub posist possoll istpos sollpos istposition
        sollposition istlage solllage lageistwert lagesollwert actpos setpos lastposition qpos drehwinkel
        motorposition ptpos schlittenposition achsposition achsenposition wagenposition positionsistwert
        positionssollwert posizione posicion
    velocity: velocity velocities vel velo speed geschwindigkeit drehzahl omega qvel nist nsoll vist vsoll
        drehzahlistwert drehzahlsollwert istdrehzahl solldrehzahl actvelo setvelo istgeschwindigkeit
        sollgeschwindigkeit geschw dtheta dphi rpm erpm vitesse velocita velocidad
        motordrehzahl
    acceleration: acceleration acc accel beschleunigung ddtheta acceler
    motor_torque: torque torques trq tau drehmoment moment effort kraft force istmoment sollmoment
        momentenistwert drehmomentistwert torqueforce tq thrust mist motorkraft antriebskraft istkraft
        sollkraft momentistwert momentsollwert motormoment motordrehmoment
        antriebsmoment couple coppia
    friction_torque: friction reibung reibmoment reibkraft reibungsmoment reibungskraft
    current: current currents strom iq amps iqist stromistwert iststrom motorstrom cur amperage courant
        corrente corriente
    voltage: voltage volts spannung volt uq motorspannung vir
    supply: supply vbus vdc udc ubat vbat battery dclink vsupply versorgung versorgungsspannung zwischenkreis
        zwischenkreisspannung
    load: normal normalforce normalkraft preload vorspannung fn load last
    temperature: temperature temp temperatur motortemp tmp
    position_error: schleppfehler schleppabstand followingerror lag poserror posdiff regelabweichung droop
    """
)
"""Words that name a quantity."""

WHOLE = _table(
    """
    time: t ts secs s sec tout ms msec millis x_value
    position: q qm q_m x y th 6064 607a_actual pl.fb s-0-0051 s-0-0053 px x_m qmes q_act pos_estimate
        encoder.pos_estimate feedback_pulse_counter p_act r2521 phi_m theta_m theta_l q_l q_meas
    velocity: v w dq qd_m dqm dx qdot n 606c vl.fb s-0-0040 vx vel_estimate r0061 r61 r0063 r63 dq_act v_act
        n_act omega_m w_m v_m thetadot q_dot theta_dot
    motor_torque: tq te t_m tm tau_m 6077 s-0-0084 r0080 r80 m_act m_motor u_tau tau_act qfrc_actuator
    friction_torque: tf t_f ff f_f tau_f m_r mr
    sensor_torque: sensor_torque torque_sensor
    current: i i_q iq_measured iq_act 6078 il.fb r0078 r78 i_act im i_m ia
    voltage: u vm u_q u_m v_motor ua
    supply: input_volts input_voltage vin v_in vbus v_bus u_bus bus_voltage udc u_dc vdc v_dc u_zk ubat vbat 6079
    acceleration: a ddq qdd qddot ddx a_act
    temperature: r0035 r35
    position_reference: qg q_d qd qr q_r q_ref q_des xd x_d 607a 6062 pl.cmd s-0-0047 input_pos r ref w_pos
        setpoint sollwert command goal reference theta_d thetad
    velocity_reference: 60ff 606b vl.cmd s-0-0036 input_vel r0062 r62 dqd dq_d v_d w_d
    current_reference: iq_setpoint il.cmd r0077
    position_error: 60f4 e pl.err s-0-0189 error position_error
    compensation_torque: 60b2 compensation_torque torque_offset
    """
)
"""Whole names (or their last part) that name a quantity."""

OF_REFERENCE = _words(
    """
    cmd command commanded demand demanded des desired drehzahlsollwert fuehrungsgroesse goal input nominal
    lagesoll lagesollwert nsoll planned possoll ref reference set setpoint setpos setvelo soll
    solldrehzahl sollgeschwindigkeit sollkraft solllage sollmoment sollpos sollposition sollwert target trajectory
    vorgabe vsoll ziel consigne momentsollwert positionssollwert riferimento
    """
)
"""Words for a reference, as opposed to a measurement."""

NAMED_BY_UNIT = frozenset(["sec", "secs", "ms", "msec", "millis", "rpm", "erpm"])
"""Times and speeds named by their unit. A bare "s" may also be a displacement (and has lower priority than "t")."""
ERROR = frozenset(["deviation", "diff", "err", "error", "fehler", "following", "lag"])
LOAD_SIDE = frozenset(
    [
        "abtrieb",
        "arm",
        "last",
        "lastposition",
        "lastseitig",
        "link",
        "load",
        "loadside",
        "lside",
        "output",
        "side2",
    ]
)
FORCE = frozenset(["force", "kraft"])
SENSOR = frozenset(["sensor", "kraftsensor", "kraftaufnehmer"])
FORCE_SYMBOL = frozenset(["f", "fm", "fmot", "fmotor"])
"""The symbol of a force, also used for a frequency, friction and normal force."""
MOTOR_SIDE = frozenset(["antrieb", "drive", "mot", "motor", "motorseitig", "rotor"])
SKIP = _words(
    """
    achse act actual axes axis estimate fb feedback filtered internal ist istwert j joint meas measured mes
    present raw value attuale mesure mesuree reale reel reelle
    """
)
NO_SIGNAL = _words(
    """
    counter enable enabled error_code flag gain id index limit mode state status std stddev stdev valid
    """
)
CARTESIAN = _words("ee eef tcp effector endeffector wrench pose flange cartesian kartesisch xyz")
"""Words for a robot's end effector: its position is not a joint angle, its force not a joint torque."""
OF_OTHERS = _words("ext external extern contact gravity coriolis disturbance")
"""Words for torques other than the motor's."""
AXES = _words("joint axis achse gelenk motor drive servo actuator axe eje")
"""Words followed by the number of an axis."""
CHANNELS = _words("ch channel kanal ai ao adc col column signal trace")
"""Words followed by a channel number of the instrument, not an axis."""
NO_TAIL = frozenset(
    ["1", "a", "c", "f", "h", "i", "in", "k", "kp", "lb", "m", "min", "n", "p", "u", "v", "x"]
)
"""Units that usually mean something else at the end of a name."""
COMPOUNDS = {
    "position": "position", "winkel": "position", "geschwindigkeit": "velocity", "drehzahl": "velocity",
    "moment": "motor_torque", "kraft": "motor_torque", "strom": "current", "temperatur": "temperature",
}  # fmt: skip
"""Endings of German compounds, and their quantity."""
OTHER_COMPOUNDS = (
    "last",
    "reib",
    "normal",
    "haft",
    "stoer",
    "gewicht",
    "feder",
    "traegheit",
    "kipp",
    "brems",
    "soll",
)
"""Beginnings of compounds for another torque or force, or for a reference."""
REFERENCED = {
    "position": "position_reference",
    "velocity": "velocity_reference",
    "current": "current_reference",
}
