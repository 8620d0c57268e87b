// A program with a Bullet of its own inside, as far as one can see from outside.
#include <typeinfo>

struct btSequentialImpulseConstraintSolver {
    virtual ~btSequentialImpulseConstraintSolver() {}
};

int main(int argc, char**) {
    btSequentialImpulseConstraintSolver* solver = argc > 0 ? new btSequentialImpulseConstraintSolver : nullptr;
    const bool named = typeid(*solver).name()[0] != '\0';
    delete solver;
    return named ? 0 : 1;
}
