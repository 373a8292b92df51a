"""What ``steer-env train`` is made of; needs the extra ``learn``, except for config, domain, kernel and records."""
