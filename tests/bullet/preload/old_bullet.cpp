// Stands for a Bullet of another version.
extern "C" int old_bullet() { return 0; }
