// Not a component: what one links against. No caller can see that it has a thread_local.
double countInThisThread();

double countInThisThread() {
    thread_local double count = 0.0;
    return ++count;
}
