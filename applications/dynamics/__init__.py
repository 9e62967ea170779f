"""Motion of elastic bodies in time: mass, damping, implicit steps, contact with rigid bodies and friction.

Units: mm, s, kPa. Force is then kPa mm2 = mN, energy mN mm = 1e-6 J, and mass mN / (mm/s2) = kg: densities are in
kg/mm3 (water 1e-6), gravity is 9,810 mm/s2, viscosity kPa s.
"""
