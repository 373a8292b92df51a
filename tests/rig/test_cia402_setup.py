"""The set-up of a CANopen drive against the canopen library's own server of objects."""

import struct

import pytest

from steer_env.errors import InputError
from steer_env.rig.bus import open_bus
from steer_env.rig.motors.cia402_setup import PDOS, configure, writes_for
from steer_env.rig.motors.dbc import dbc

canopen = pytest.importorskip("canopen", reason="the canopen library is not installed")
NODE = 5


def dictionary():
    """The objects that are written or read, and no other."""
    od = canopen.ObjectDictionary()
    types = {"<B": 0x05, "<b": 0x02, "<H": 0x06, "<h": 0x03, "<I": 0x07}
    records = {}
    objects = [(w.address, w.sub, types[w.form]) for w in writes_for(NODE, 1.0)]
    for index, sub, kind in dict.fromkeys([*objects, (0x6502, 0, 0x07), (0x6076, 0, 0x07)]):
        variable = canopen.objectdictionary.ODVariable(f"{index:04X}.{sub}", index, sub)
        variable.data_type, variable.access_type, variable.default = kind, "rw", 0
        if index < 0x1F00 and index != 0x1017:
            if index not in records:
                records[index] = canopen.objectdictionary.ODRecord(f"{index:04X}", index)
                od.add_object(records[index])
            records[index].add_member(variable)
        else:
            od.add_object(variable)
    return od


@pytest.fixture
def drive():
    """A node on an in-process bus that supports mode 10 and is rated 7500."""
    network = canopen.Network()
    network.connect(interface="virtual", channel="cia402-setup")
    node = network.create_node(NODE, dictionary())
    node.sdo[0x6502].raw, node.sdo[0x6076].raw = 1 << 9, 7500
    yield node
    network.disconnect()


def test_the_map_in_the_drive_is_the_one_of_the_dbc(drive):
    """Catches a PDO that would carry other objects, or other lengths, than the codec reads."""
    found = configure(open_bus("virtual", "cia402-setup"), NODE, 0.4)
    assert found.rated_raw == 7500
    assert found.rated_as_mNm == pytest.approx(7.5)
    file = dbc("cia402")
    for (communication, mapping, _, _), name in zip(PDOS, ("ReceivePdo1", "TransmitPdo1", "TransmitPdo2"), strict=True):
        assert drive.sdo[communication][1].raw & 0x8000_07FF == file.identifier(name) + NODE - 1  # and enabled
        assert drive.sdo[communication][2].raw == 1
        count = drive.sdo[mapping][0].raw
        lengths = [drive.sdo[mapping][k].raw & 0xFF for k in range(1, count + 1)]
        signals = sorted(file.messages[name].signals, key=lambda signal: signal.start)
        assert lengths == [signal.length for signal in signals]
    assert drive.sdo[0x6060].raw == 10
    assert drive.sdo[0x6072].raw == 400
    assert drive.sdo[0x60B2].raw == 0


def test_no_torque_is_written():
    """Neither a target nor a control word."""
    assert not {write.address for write in writes_for(NODE, 1.0)} & {0x6040, 0x6071, 0x60FF, 0x607A}


def test_a_drive_without_the_mode_is_refused(drive):
    drive.sdo[0x6502].raw = 1 << 3
    with pytest.raises(InputError, match="cyclic synchronous torque"):
        configure(open_bus("virtual", "cia402-setup"), NODE)
    assert drive.sdo[0x6060].raw == 0


def test_a_drive_that_keeps_another_value_is_refused(drive, monkeypatch):
    """As makers do whose map is fixed."""
    monkeypatch.setattr(drive, "set_data", lambda *_, **__: None)
    drive.data_store[0x1600] = {0: struct.pack("<B", 2)}
    with pytest.raises(InputError, match=r"after|refused"):
        configure(open_bus("virtual", "cia402-setup"), NODE)


def test_silence_is_said():
    with pytest.raises(InputError, match="does not answer"):
        configure(open_bus("virtual", "cia402-nobody"), NODE, timeout=0.01)
