extern "C" int old_bullet();
int main() { return old_bullet(); }
