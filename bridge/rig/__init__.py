"""A rig of any kind behind its guard, as a process on the bus. Nothing here knows the plant or an adapter.

device   the contract of a device: converter and exciter, together or each alone
node     a rig of any kind behind its guard, block by block
device_node  a device behind its guard
step     a block between its messages, compiled; the plant's loop calls the same parts
rate     the measured rate of a device
watch    faults that show in the times of its blocks, and in the vibration that it executes
file     the rig file of a real rig
derived  channels that its formulas derive from measured ones
load     the device that it describes, by its adapter
real     this device, opened, behind its guard
check    the channels of a device with its exciter at rest
conformance/  25 checks of an adapter with its device, or of a client on the bus
adapters/  one file for each kind of device
process  the loop on the bus: fade, latch, kept gain, missing commands, run number
faults/  injected faults of sensors, clock and bus
"""
