/* What systems do differently: files by names in UTF-8, other programs, signals. system_posix.c,
 * system_windows.c. SPDX-License-Identifier: MIT
 *
 * What fails returns false, NULL or -1 with errno. */
#ifndef ASCC_SYSTEM_H
#define ASCC_SYSTEM_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

/* At the program's start: words in UTF-8, files and streams in bytes, and no file that is opened takes the
 * place of a standard stream that is closed. */
void ascc_system_start(int *argc, char ***argv);

#if defined(_WIN32)
#define ASCC_SEPARATORS "/\\" /* between the parts of a path */
#else
#define ASCC_SEPARATORS "/"
#endif

/* Of functions that take a format of printf: which argument it is, and the first that it tells of. */
#if defined(__MINGW32__) && !defined(__clang__)
#define ASCC_FORMAT(text, first) __attribute__((format(gnu_printf, text, first)))
#elif defined(__GNUC__)
#define ASCC_FORMAT(text, first) __attribute__((format(printf, text, first)))
#else
#define ASCC_FORMAT(text, first)
#endif

bool ascc_system_is_absolute(const char *path);
/* The last part of a path. */
const char *ascc_system_name(const char *path);

typedef struct ascc_about {
    bool folder, regular;
    unsigned mode; /* permissions */
    uint64_t size; /* bytes */
} ascc_about;

/* Of what a path leads to, links followed. */
bool ascc_system_look(const char *path, ascc_about *about);
/* Is there anything, whatever it is? */
bool ascc_system_there(const char *path);
bool ascc_system_same(const char *a, const char *b);
/* May it be written: a file; new files into a folder? */
bool ascc_system_may_write(const char *path);
bool ascc_system_may_fill(const char *folder);
bool ascc_system_make_folder(const char *path);

/* As fopen. */
FILE *ascc_system_open(const char *path, const char *mode);
bool ascc_system_cut(FILE *file, long length);

/* Paths that a pattern with * and ? means, *count of them in the order of their bytes; the folder stands before
 * it, where it is not absolute, and is meant as it is. From malloc, as each path is; NULL: none, no memory. */
char **ascc_system_match(const char *folder, const char *pattern, size_t *count);

/* Path of what a chain of links leads to, which need not be there. */
bool ascc_system_follow_links(char *path, size_t capacity);
/* A file to write that no other program is writing (else EBUSY), with that mode or 0; what a program that was
 * killed left there goes. */
FILE *ascc_system_create(const char *path, unsigned mode);
/* A nameless file in the same folder, gone when it is closed. */
FILE *ascc_system_scratch(const char *path);
bool ascc_system_sync(FILE *file);
/* The file takes the name, and that of its folder's disk. */
bool ascc_system_replace(const char *from, const char *to, const char *folder);
void ascc_system_remove(const char *path);

bool ascc_system_is_terminal(FILE *stream);
/* Another program goes on in place of this one: `name` beside `self`, as this one was called, or on the PATH. Returns
 * where there is none. */
void ascc_system_become(const char *self, const char *name, char **words);
/* Runs a program whose input is written by a function; false where it is not there or fails. */
bool ascc_system_feed(const char *program, void (*write)(FILE *to, const void *data),
                      const void *data);
/* Ctrl-C and the like call it, a second one ends the program; a file too large is an error like others. */
void ascc_system_on_interrupt(void (*handler)(int number));
int32_t ascc_system_processors(void);

#endif
