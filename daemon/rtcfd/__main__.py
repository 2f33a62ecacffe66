"""`python3 -m rtcfd`."""

from rtcfd.main import end, main

end(main())
