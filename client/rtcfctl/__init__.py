"""rtcfctl, the command line of rtcf: a package for each subject, a module for each noun."""
