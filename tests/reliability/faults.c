/* Fail one system call on a file below a folder, counted from the start of the process.
 *
 * OPAMC_FAULT_DIR   the folder
 * OPAMC_FAULT_AT    which call fails, counted from 1; 0: none
 * OPAMC_FAULT_ERRNO what it fails with
 *
 * Calls are counted from when the folder is named, which a fork does for itself.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

#define MOST 4096
static char ours[MOST];
static long seen;

static int fails(void) {
    const char *at = getenv("OPAMC_FAULT_AT"), *number = getenv("OPAMC_FAULT_ERRNO");
    if (__sync_add_and_fetch(&seen, 1) != (at ? atol(at) : 0)) return 0;
    errno = number ? atoi(number) : EIO;
    return 1;
}
static int below(const char *path) {
    const char *folder = getenv("OPAMC_FAULT_DIR");
    /* the lock is no result; relative paths are not used by the tests */
    return folder && path && !strncmp(path, folder, strlen(folder)) && !strstr(path, ".lock");
}
long opamc_fault_calls(void) { return seen; }
#define REAL(name) __typeof__(&name) real = (__typeof__(&name))dlsym(RTLD_NEXT, #name)
#define OPEN(name)                                                                   \
    int name(const char *path, int flags, ...) {                                     \
        va_list rest; va_start(rest, flags);                                         \
        mode_t mode = va_arg(rest, mode_t); va_end(rest);                            \
        REAL(name);                                                                  \
        if (below(path) && (flags & (O_WRONLY | O_RDWR | O_CREAT)) && fails()) return -1; \
        int fd = real(path, flags, mode);                                            \
        if (fd >= 0 && fd < MOST) ours[fd] = (char)below(path);                      \
        return fd;                                                                   \
    }
OPEN(open)
OPEN(open64)
ssize_t write(int fd, const void *data, size_t size) {
    REAL(write);
    return fd >= 0 && fd < MOST && ours[fd] && fails() ? -1 : real(fd, data, size);
}
#define PLACED(name, offset)                                                         \
    ssize_t name(int fd, const void *data, size_t size, offset at) {                 \
        REAL(name);                                                                  \
        return fd >= 0 && fd < MOST && ours[fd] && fails() ? -1 : real(fd, data, size, at); \
    }
PLACED(pwrite, off_t) /* as SQLite writes */
PLACED(pwrite64, off64_t)
#define FLUSH(name)                                                                  \
    int name(int fd) {                                                               \
        REAL(name);                                                                  \
        return fd >= 0 && fd < MOST && ours[fd] && fails() ? -1 : real(fd);          \
    }
FLUSH(fsync)
FLUSH(fdatasync)
int close(int fd) {
    REAL(close);
    int failing = fd >= 0 && fd < MOST && ours[fd] && fails(), number = errno;
    if (fd >= 0 && fd < MOST) ours[fd] = 0;
    int done = real(fd);
    if (failing) { errno = number; return -1; }
    return done;
}
#define TWO(name)                                                                    \
    int name(const char *from, const char *to) {                                     \
        REAL(name);                                                                  \
        return below(to) && fails() ? -1 : real(from, to);                           \
    }
TWO(rename)
TWO(link)
TWO(symlink)
int renameat2(int a, const char *from, int b, const char *to, unsigned flags) {
    REAL(renameat2);
    return below(to) && fails() ? -1 : real(a, from, b, to, flags);
}
int mkdir(const char *path, mode_t mode) {
    REAL(mkdir);
    return below(path) && fails() ? -1 : real(path, mode);
}
