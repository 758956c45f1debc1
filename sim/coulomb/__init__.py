"""Rigid parts on springs with exact Coulomb friction: the engine that judges everything with friction.

Friction in MuJoCo is associated: what slides is lifted by μ times the way, so what sits between parallel faces jams
itself. Here sliding lifts nothing. The springs stand at the contact points of the statics.
"""
