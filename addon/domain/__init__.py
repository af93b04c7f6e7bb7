"""What Sanguine knows: parameters, action units, emotions, blood, effects, the plan, the head. Never imports bpy."""
