"""Study of the stiffness map within the organ: are its errors what it says, and what can it find?"""
