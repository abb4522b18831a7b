"""The paper's rig in MuJoCo: a slide joint with the LuGre friction of a dcmotor, its loop in C by `rollout`.

The joint's coordinate is x - u, because the friction of a dcmotor acts between a joint and its parent. The
acceleration of the base enters as the force -m u'', its mean over each step, so that sampling a cosine adds
no error.
"""

import math
import time

import numpy as np

from tests.speed import case as paper
from tests.speed.case import Case
from tests.speed.solvers import Run


def mujoco(case: Case, setting: tuple[str, float]) -> Run:
    """MuJoCo at a setting (integrator, step_s)."""
    import mujoco as mj
    from mujoco import rollout

    integrator, step_s = setting
    # input="none" and a motor constant of 1e-6: friction only, with a back-EMF drag of 1e-12 N s/m. The drive
    # spring is a separate actuator; its activation is s_d, integrated from its control, the velocity v_d.
    model = mj.MjModel.from_xml_string(f"""
        <mujoco>
          <option timestep="{step_s!r}" gravity="0 0 0" integrator="{integrator}">
            <flag contact="disable" constraint="disable"/>
          </option>
          <worldbody><body>
            <joint name="slide" type="slide" axis="1 0 0"/>
            <geom type="sphere" size="0.1" mass="{paper.m}"/>
          </body></worldbody>
          <actuator>
            <intvelocity joint="slide" kp="{paper.k_d}" actrange="-1 1"/>
            <dcmotor joint="slide" motorconst="1e-6" resistance="1" input="none"
                     lugre="{paper.k_t} {paper.h_t} {paper.F_c} {paper.F_s} {paper.v_s}"/>
          </actuator>
        </mujoco>""")
    steps = round(case.duration_s / step_s)
    phase = case.omega * step_s * np.arange(steps + 1)
    base_m, base_mps = case.amplitude_m * np.sin(phase), case.base_velocity_mps * np.cos(phase)
    control = np.empty((1, steps, 2))
    control[0, :, 0] = paper.DRIVE_VELOCITY_MPS
    control[0, :, 1] = -paper.m * np.diff(base_mps) / step_s - paper.k_d * 0.5 * (base_m[1:] + base_m[:-1])
    x, v, z = case.start
    start = np.array([[case.from_s, x, v - case.base_velocity_mps, paper.DRIVE_VELOCITY_MPS * case.from_s, z]])
    states = np.zeros((1, steps, 5))
    given = int(mj.mjtState.mjSTATE_CTRL | mj.mjtState.mjSTATE_QFRC_APPLIED)
    data = mj.MjData(model)
    begin = time.perf_counter()
    rollout.rollout(model, data, start, control, control_spec=given, state=states)
    wall_s = time.perf_counter() - begin
    every = max(1, math.floor(paper.SAMPLE_S / step_s))
    velocity_mps = states[0, :, 2] + base_mps[1:]
    return Run(wall_s, states[0, ::every, 0], velocity_mps[::every])
