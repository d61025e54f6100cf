"""Pictures by rays: what is traced from each pixel, as plain data, and the compiler that makes it."""
