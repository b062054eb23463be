"""Two machines with every kind of thing of the machine file, and a parameter in each."""

SPATIAL_KINDS = """
    units: {length: mm, angle: deg, force: N}
    space: spatial
    gravity: [0, 0, -9.81]
    ranges: {length: 0.1, angle: 0.01, scale: 1e-3, mass: 0.1, density: 100 kg/m^3, modulus: 2 GPa, second_moment: 1000,
      area: 20, stiffness: 500, rotational_stiffness: 1e5, force: 10, torque: 1000}
    parameters:
      offset1: 200
      scale1: 1
      k1: {nominal: 20000, unit: N/mm}
      R2: 30
      ES2: {nominal: 500000, unit: N}
      fx: {nominal: 1, unit: deg}
      fy: {nominal: -2, unit: deg}
      fz: {nominal: 3, unit: deg}
      g3: 5
      gy: {nominal: 3000, unit: N/mm}
      gr: {nominal: 3e6, unit: N mm/rad}
      gc: {nominal: 1e4, unit: N/rad, range: 1000}
      kd3: {nominal: 4000, unit: N/mm}
      l3: 400
      ES3: {nominal: 4e6, unit: N}
      zero3: 0
      r4: 150
      kd4: {nominal: 2e8, unit: N mm/rad}
      kt: {nominal: 1e6, unit: N mm/rad}
      D5: 30
      d5: 20
      E: 200 GPa
      rho: 7850 kg/m^3
      a5: 200
      ku: {nominal: 5e7, unit: N mm/rad}
      kp: {nominal: 8000, unit: N/mm}
      kd5: {nominal: 5000, unit: N/mm}
      I6: {nominal: 20000, unit: mm^4}
      J6: {nominal: 9000, unit: mm^4}
      A6: {nominal: 500, unit: mm^2}
      m: {nominal: 12, unit: kg}
      cx: 20
      F: {nominal: 300, unit: N}
      M: {nominal: 5000, unit: N mm}
      tool: 80
      p1x: 100
      p4z: -10
      b6: 300
    frames: {tilted: {at: [-450, g3, 0], turn: [fx, fy, fz]}}
    guides:
      rail: {frame: tilted, at: [0, 0, 10], along: z, stiffness: {x: gy, y: gy, rx: gr, ry: gr, rz: gr, x_ry: gc}}
    ground: {B1: [300, 100, 0], B2: [0, 60, 900], B4: [0, 400, 0], B5: [-300, 100, 0], B6: [b6, 300, 350]}
    bodies:
      platform:
        at: [0, 0, 400]
        turn: [3, -2, 5]
        mass: m
        centre: [cx, 0, 10]
        points:
          {P1: [p1x, -60, 0], P2: [0, 40, 20], P3: [-120, 30, 0], P4: [0, 120, p4z], P5: [-80, -90, 0], P6: [99, 60, 0]}
      c3: {guide: rail, at: 20, points: {C3: [20, 0, 30]}}
      crank: {at: [0, 400, 0], points: {K4: [0, -r4, 30]}}
    nodes: {m5: [-201, 14, 180], n5: [-179, -4, 220], e6: [200, 180, 380]}
    materials: {steel: {E: E, nu: 0.3, density: rho}}
    sections: {tube: {tube: [D5, d5]}, given: {area: A6, Iy: 1.5*I6, Iz: I6, J: J6}}
    bars:
      leg1: {between: [B1, P1], k: k1}
      rod3: {between: [C3, P3], length: l3, EA: ES3, mass: 0.5}
      rod4: {between: [K4, P4], k: k1}
    ropes: {line2: {between: [B2, P2], EA: ES2}}
    beams:
      lower5: {between: [B5, m5], ends: [{joint: universal, stiffness: {rz: ku}}, fixed], section: tube,
               material: steel}
      upper5: {between: [n5, P5], ends: [fixed, {joint: spherical, stiffness: kp}], length: a5, section: tube,
               material: steel, pieces: 2}
      arm6: {between: [B6, e6], section: given, material: steel, up: [0, 0.2, 1]}
      tip6: {between: [e6, P6], ends: [{joint: revolute, axis: [0.2, 0, 1], stiffness: {radial: kp, rx: ku, ry: ku}},
             spherical], section: tube, material: steel}
    joints:
      hub: {between: [B4, crank], type: revolute, axis: x, stiffness: {rz: kt}}
      slide5: {between: [m5, n5], type: prismatic}
    actuators:
      q1: {drives: leg1, offset: offset1, scale: scale1}
      q2: {winds: line2, radius: R2, ratio: 0.25, zero: home, redundant: true}
      q3: {moves: c3, stiffness: kd3, zero: zero3}
      q4: {turns: crank, stiffness: kd4, redundant: true}
      q5: {drives: slide5, stiffness: kd5}
    loads: {push: {at: P6, force: [F, 0, 50]}, twist: {at: platform, moment: [0, M, 2000]}}
    sensors:
      tracker: {kind: tcp, at: platform, offset: [0, 0, tool], reads: [x, y, z, rx, ry, rz], frame: machine,
        sigma: {position: 1 um, orientation: 1 urad}}
    """

PLANAR_KINDS = """
    units: {length: mm, angle: deg, force: N}
    space: planar
    gravity: [0, -9.81]
    ranges: {length: 0.1, angle: 0.01, scale: 1e-3, mass: 0.1, modulus: 2 GPa, stiffness: 500,
      rotational_stiffness: 1e5, force: 10, torque: 1000}
    parameters:
      gt: 4
      g1: 3
      gy: {nominal: 3000, unit: N/mm}
      gr: {nominal: 3e6, unit: N mm/rad}
      gc: {nominal: -1e4, unit: N/rad, range: 1000}
      kd1: {nominal: 4000, unit: N/mm}
      s1: 1.02
      z1: 5
      l1: 400
      ES1: {nominal: 4e6, unit: N}
      r2: 120
      z2: 10
      k2: {nominal: 30000, unit: N/mm}
      E: 200 GPa
      b: 20
      h: 15
      a3: 180
      k3: {nominal: 6000, unit: N/mm}
      kr: {nominal: 1e6, unit: N mm/rad}
      r4: 100
      kd4: {nominal: 2e8, unit: N mm/rad}
      F: {nominal: 200, unit: N}
      M: {nominal: 3000, unit: N mm}
      m: {nominal: 5, unit: kg}
      cx: 15
      tool: 40
      ax: 60
    frames: {tilted: {at: [-300, g1], turn: gt}}
    guides: {rail: {frame: tilted, along: x, stiffness: {y: gy, rz: gr, y_rz: gc}}}
    ground: {B2: [300, 0], B3: [0, 600], B4: [350, 500]}
    bodies:
      platform:
        at: [0, 300]
        turn: 5
        mass: m
        centre: [cx, 5]
        points: {P1: [-ax, -20], P2: [60, -20], P3: [0, 40], P4: [60, 30]}
      c1: {guide: rail, at: 40, mass: 2, points: {C1: [10, 30]}}
      crank2: {at: [300, 0], turn: 120, points: {K2: [r2, 0]}}
      crank4: {at: [350, 500], turn: -120, points: {K4: [r4, 0]}}
    nodes: {u3: [0, 470], v3: [0, 450]}
    materials: {steel: {E: E, density: 7850 kg/m^3}}
    sections: {flat: {rectangle: [b, h]}}
    bars:
      rod1: {between: [C1, P1], length: l1, EA: ES1}
      rod2: {between: [K2, P2], k: k2}
      rod4: {between: [K4, P4], k: k2, mass: 0.3}
    beams:
      top3: {between: [B3, u3], ends: [{joint: revolute, stiffness: k3}, fixed], section: flat, material: steel,
             pieces: 2}
      low3: {between: [v3, P3], ends: [fixed, {joint: fixed, stiffness: {x: k3, y: k3, rz: kr}}], length: a3,
             section: flat, material: steel}
    joints:
      hub2: {between: [B2, crank2], type: revolute}
      hub4: {between: [B4, crank4], type: revolute}
      slide3: {between: [u3, v3], type: prismatic, axis: y}
    actuators:
      q1: {moves: c1, stiffness: kd1, scale: s1, zero: z1}
      q2: {turns: crank2, zero: z2}
      q3: {drives: slide3, redundant: true}
      q4: {turns: hub4, stiffness: kd4, redundant: true}
    loads: {push: {at: P4, force: [F, 20]}, twist: {at: platform, moment: M}, bend: {at: u3, moment: 500}}
    sensors:
      tracker: {kind: tcp, at: platform, offset: [tool, 10], reads: [x, y, rz], frame: machine,
        sigma: {position: 1 um, orientation: 1 urad}}
    """
