# gonio: builds everything into build/<variant>/ and links build/<program> to the release variant.
#
#   make                 the four programs             make demo     a whole campaign on the simulated bench
#   make check           unit and system tests         make layers   who may include whom
#   make bench           what things cost, as a table and in build/bench.json
#   make check-slow      statistics of the fit's intervals, faults of links, power cuts, simulated campaigns, deaths
#   make coverage-guard  every branch of what decides that a laser goes off
#   make install         PREFIX=/usr/local DESTDIR=    V=1           show the commands
#
# A variant is a compiler and its flags: release, clang, asan, debug. VARIANT=asan make check.

VARIANT ?= release
B       := build/$(VARIANT)
PREFIX  ?= /usr/local
DESTDIR ?=
VERSION := 0.1.0

CC_release := $(if $(filter default,$(origin CC)),gcc,$(CC))
CC_debug   := $(CC_release)
CC_clang   := clang
CC_asan    := gcc
OPT_release := -O2 -g
OPT_clang   := -O2 -g
OPT_debug   := -Og -g3
OPT_asan    := -O1 -g -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer
override CC := $(CC_$(VARIANT))
$(if $(CC),,$(error unknown VARIANT '$(VARIANT)': release, clang, asan or debug))

WARN := -Wall -Wextra -Wshadow -Wstrict-prototypes -Wmissing-prototypes -Wpointer-arith -Wformat=2 -Wvla \
        -Wdouble-promotion $(if $(CI)$(WERROR),-Werror)
CPPFLAGS += -I. -D_GNU_SOURCE -DGONIO_VERSION='"$(VERSION)"'
CFLAGS   := -std=c17 $(WARN) $(OPT_$(VARIANT)) -ffp-contract=off -fno-math-errno -pthread $(EXTRA_CFLAGS)
LDFLAGS  += -Wl,--as-needed $(filter -fsanitize% -fno-sanitize%,$(CFLAGS)) -pthread

# The layers, and for each program the layers it is made of, users before what they use.
LAYERS        := base model fit drivers campaign sim guard daemon cli
USES_goniod   := daemon campaign drivers fit model base
USES_gonio-guard := guard drivers base
USES_gonio    := cli campaign drivers fit model base
USES_goniosim := sim drivers model base
LIBS_base     := -lconfig
LIBS_drivers  := -lmodbus -lserialport -lusb-1.0
LIBS_campaign := -lsqlite3 -ljansson
LIBS_sim      := -ljansson
LIBS_daemon   := -lmicrohttpd -ljansson
LIBS_cli      := -lcurl -ljansson
PROGRAMS      := goniod gonio-guard gonio goniosim
MAIN_goniod   := daemon
MAIN_gonio-guard := guard
MAIN_gonio    := cli
MAIN_goniosim := sim

Q := $(if $(V),,@)
say = $(if $(V),,@printf '  %-5s %s\n' $(1) $(2))

.DEFAULT_GOAL := all
.PHONY: all bench check check-slow coverage-guard check-deaths unit system demo deps deps-check deps-bench layers install uninstall clean doc lint
all: $(PROGRAMS:%=$(B)/%) build/share/gonio/profiles $(if $(filter release,$(VARIANT)),$(PROGRAMS:%=build/%))

# --- objects, one archive a layer, programs -------------------------------------------------------
objects = $(patsubst %.c,$(B)/obj/%.o,$(filter-out $(1)/main.c,$(wildcard $(1)/*.c)))
OBJECTS :=
define layer_rules
OBJECTS += $(call objects,$(1))
$(B)/lib$(1).a: $(call objects,$(1))
	$$(call say,AR,$$@)
	$(Q)rm -f $$@ && $(AR) rcs $$@ $$^
endef
$(foreach l,$(LAYERS),$(eval $(call layer_rules,$(l))))

# Profiles are found beside a program: ../share/gonio/profiles, as where they are installed.
build/share/gonio/profiles:
	$(Q)mkdir -p $(@D) && ln -sfn ../../../configs/profiles $@

libs_of = $(sort $(foreach l,$(1),$(LIBS_$(l)))) -lm
define program_rules
OBJECTS += $(B)/obj/$(MAIN_$(1))/main.o
$(B)/$(1): $(B)/obj/$(MAIN_$(1))/main.o $(USES_$(1):%=$(B)/lib%.a)
	$$(call say,LINK,$$@)
	$(Q)$(CC) $(LDFLAGS) -o $$@ $$^ $(call libs_of,$(USES_$(1)))
build/$(1): $(B)/$(1)
	$(Q)ln -sfn $(VARIANT)/$(1) $$@
endef
$(foreach p,$(PROGRAMS),$(eval $(call program_rules,$(p))))

$(B)/obj/%.o: %.c Makefile
	$(call say,CC,$<)
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) $(CPPFLAGS) $(CFLAGS) -MMD -MP -c -o $@ $<

# Numeric kernels are worth the vectoriser; flags are per file because optimize() attributes disable it.
# Nobody reads the floating-point exception flags, and without them a conditional becomes a maximum.
$(B)/obj/model/%.o $(B)/obj/fit/%.o $(B)/obj/bench/%.o: CFLAGS += $(if $(filter asan debug,$(VARIANT)),,-O3 -fno-trapping-math)

# The batch kernels are compiled once for each instruction set and chosen at run time (model/batch.h);
# on machines other than x86 these files are empty.
X86 := $(filter x86_64-%,$(shell $(CC) -dumpmachine))
$(B)/obj/%_avx2.o: CFLAGS += $(if $(X86),-mavx2 -mfma)
$(B)/obj/%_avx512.o: CFLAGS += $(if $(X86),-mavx512f -mavx512dq -mavx2 -mfma)

# --- tests ----------------------------------------------------------------------------------------
# tests/unit/test_<module>.c is one program. The layers it needs are named in its first lines: '// uses: fit model'.
UNIT_TESTS := $(patsubst tests/unit/%.c,%,$(wildcard tests/unit/test_*.c))
uses = $(shell sed -n 's,^// uses: *,,p' tests/unit/$(1).c)
define test_rules
OBJECTS += $(B)/obj/tests/unit/$(1).o
$(B)/tests/$(1): $(B)/obj/tests/unit/$(1).o $(patsubst %,$(B)/lib%.a,$(call uses,$(1)))
	$$(call say,LINK,$$@)
	$(Q)mkdir -p $$(@D)
	$(Q)$(CC) $(LDFLAGS) -o $$@ $$^ -lcmocka $(call libs_of,$(call uses,$(1)))
endef
$(foreach t,$(UNIT_TESTS),$(eval $(call test_rules,$(t))))

# tests/slow/check_<what>.c: statistics that take minutes; each prints its seeds, a table, and fails by status.
SLOW_TESTS := $(patsubst tests/slow/%.c,%,$(wildcard tests/slow/check_*.c))
slow_uses = $(shell sed -n 's,^// uses: *,,p' tests/slow/$(1).c)
define slow_rules
OBJECTS += $(B)/obj/tests/slow/$(1).o
$(B)/tests/$(1): $(B)/obj/tests/slow/$(1).o $(patsubst %,$(B)/lib%.a,$(call slow_uses,$(1)))
	$$(call say,LINK,$$@)
	$(Q)mkdir -p $$(@D)
	$(Q)$(CC) $(LDFLAGS) -o $$@ $$^ $(call libs_of,$(call slow_uses,$(1)))
endef
$(foreach t,$(SLOW_TESTS),$(eval $(call slow_rules,$(t))))

# tests/dst: one program that simulates whole campaigns in virtual time, with libc's calls its own.
DST_OBJ := $(patsubst %.c,$(B)/obj/%.o,$(wildcard tests/dst/*.c))
DST_USES := $(shell sed -n 's,^// uses: *,,p' tests/dst/main.c)
OBJECTS += $(DST_OBJ)
$(B)/tests/dst: $(DST_OBJ) $(DST_USES:%=$(B)/lib%.a)
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) $(LDFLAGS) -o $@ $^ $(call libs_of,$(DST_USES))

check-slow: $(SLOW_TESTS:%=$(B)/tests/%) $(B)/tests/dst
	$(Q)set -e; for t in $^; do $$t; done
	$(Q)$(if $(CI),,$(MAKE) --no-print-directory check-deaths)

# goniod dies 1,000 times with the laser on, 250 times each way (an hour or so). In CI the system tests do that 20 times.
check-deaths: all $(B)/tests/libmishap.so
	$(Q)GONIO_BUILD=$(abspath $(B)) GONIO_JOBS=4 GONIO_GUARD_DEATHS=250 scripts/system -rP -k off_follows

SHIMS := $(patsubst tests/shim/%.c,$(B)/tests/lib%.so,$(wildcard tests/shim/*.c))
$(B)/tests/lib%.so: tests/shim/%.c
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) $(CPPFLAGS) -std=c17 $(WARN) -O1 -g -fPIC -shared -o $@ $< -ldl

# tests/usb: a USB device under umockdev, and a program that asks over a link. '// with:' names further parts.
USB_PROGRAMS := linkask $(if $(wildcard /usr/include/umockdev-1.0/umockdev.h),usbsim)
UMOCKDEV     := $(if $(filter usbsim,$(USB_PROGRAMS)),$(shell pkg-config --cflags umockdev-1.0 | sed 's/-I/-isystem /g'))
usb_named = $(shell sed -n 's,^// $(2): *,,p' tests/usb/$(1).c)
usb_parts = $(patsubst %,$(B)/obj/tests/usb/%.o,$(1) $(call usb_named,$(1),with))
define usb_rules
OBJECTS += $(call usb_parts,$(1))
$(B)/tests/$(1): $(call usb_parts,$(1)) $(patsubst %,$(B)/lib%.a,$(call usb_named,$(1),uses))
	$$(call say,LINK,$$@)
	$(Q)mkdir -p $$(@D)
	$(Q)$(CC) $(LDFLAGS) -o $$@ $$^ $(call libs_of,$(call usb_named,$(1),uses)) \
	    $(if $(filter usbsim,$(1)),-lumockdev -lgobject-2.0 -lglib-2.0)
endef
$(foreach u,$(USB_PROGRAMS),$(eval $(call usb_rules,$(u))))
$(B)/obj/tests/usb/usbserver.o $(B)/obj/tests/usb/ttyserver.o: CPPFLAGS += $(UMOCKDEV)

unit: $(UNIT_TESTS:%=$(B)/tests/%)
	$(Q)scripts/unit $(B)/tests $(UNIT_TESTS)

system: all $(USB_PROGRAMS:%=$(B)/tests/%) $(SHIMS)
	$(Q)GONIO_BUILD=$(abspath $(B)) scripts/system $(ARGS)

# Parallel on its own unless the caller chose a number of jobs.
PARALLEL = $(if $(filter -j% --jobserver%,$(MAKEFLAGS)),,-j$(shell nproc))
check: deps-check
	$(Q)$(MAKE) --no-print-directory $(PARALLEL) all layers $(UNIT_TESTS:%=$(B)/tests/%)
	$(Q)$(MAKE) --no-print-directory -Otarget -j2 unit system

layers:
	$(Q)scripts/layers

coverage-guard:
	$(Q)scripts/coverage-guard

# --- bench ----------------------------------------------------------------------------------------
# bench/NAME.c is a program when it names its layers ('// uses: fit model'); bench/NAME_*.c are its parts,
# and what it shares with others follows '// with: naive'. It prints a JSON object a line (bench/report.h);
# scripts/bench collects them.
BENCHES := $(patsubst bench/%.c,%,$(shell grep -ls '^// uses:' bench/*.c))
named = $(shell sed -n 's,^// $(2): *,,p' bench/$(1).c)
parts = $(patsubst %.c,$(B)/obj/%.o,bench/$(1).c $(wildcard bench/$(1)_*.c) $(patsubst %,bench/%.c,$(call named,$(1),with)))
define bench_rules
OBJECTS += $(call parts,$(1))
$(B)/bench/$(1): $(call parts,$(1)) $(patsubst %,$(B)/lib%.a,$(call named,$(1),uses))
	$$(call say,LINK,$$@)
	$(Q)mkdir -p $$(@D)
	$(Q)$(CC) $(LDFLAGS) -o $$@ $$^ $(call libs_of,$(call named,$(1),uses))
endef
$(foreach b,$(BENCHES),$(eval $(call bench_rules,$(b))))

# bench/peers/ is one program: gonio's fit beside other optimisers. One whose package is missing is
# left out and reported as not measured. CMA-ES ends with a local search of NLopt.
PEERS_NLOPT    := $(wildcard /usr/include/nlopt.h)
PEERS_CMINPACK := $(wildcard /usr/include/cminpack-1/cminpack.h)
PEERS_CMAES    := $(and $(PEERS_NLOPT),$(wildcard /usr/include/pagmo/pagmo.hpp))
PEERS_OUT := $(foreach p,NLOPT CMINPACK CMAES,$(if $(PEERS_$(p)),,bench/peers/$(shell echo $(p) | tr A-Z a-z).c))
PEERS_OBJ := $(patsubst %.c,$(B)/obj/%.o,$(filter-out $(PEERS_OUT),$(wildcard bench/peers/*.c)))
PEERS_CXX := $(if $(PEERS_CMAES),$(B)/obj/bench/peers/pagmo.o)
OBJECTS   += $(PEERS_OBJ) $(PEERS_CXX)
$(PEERS_OBJ): CPPFLAGS += $(foreach p,NLOPT CMINPACK CMAES,$(if $(PEERS_$(p)),-DPEERS_$(p))) \
    $(if $(PEERS_CMINPACK),-isystem $(dir $(PEERS_CMINPACK)))
$(B)/obj/bench/peers/pagmo.o: bench/peers/pagmo.cpp Makefile
	$(call say,CXX,$<)
	$(Q)mkdir -p $(@D)
	$(Q)$(CXX) $(CPPFLAGS) -isystem /usr/include/eigen3 -std=c++17 -Wall -Wextra -O2 -MMD -MP -c -o $@ $<
$(B)/bench/peers: $(PEERS_OBJ) $(PEERS_CXX) $(B)/libfit.a $(B)/libmodel.a
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D)
	$(Q)$(if $(PEERS_CXX),$(CXX),$(CC)) $(LDFLAGS) -o $@ $^ $(if $(PEERS_NLOPT),-lnlopt) \
	    $(if $(PEERS_CMINPACK),-lcminpack) $(if $(PEERS_CMAES),-lpagmo -ltbb) -lm

BENCH_PROGRAMS := $(BENCHES:%=$(B)/bench/%) $(B)/bench/peers
bench: deps-bench
	$(Q)$(MAKE) --no-print-directory $(PARALLEL) $(BENCH_PROGRAMS)
	$(Q)scripts/bench build/bench.json $(BENCH_PROGRAMS)

# --- first contact --------------------------------------------------------------------------------
deps:
	$(Q)scripts/deps build
deps-check:
	$(Q)scripts/deps build check
deps-bench:
	$(Q)scripts/deps build bench
demo: deps
	$(Q)$(MAKE) --no-print-directory $(PARALLEL) all
	$(Q)scripts/demo

# --- installation ---------------------------------------------------------------------------------
MAN := $(patsubst doc/%.scd,$(B)/man/%,$(wildcard doc/*.scd))
doc: $(MAN)
$(B)/man/%: doc/%.scd scripts/man $(PROGRAMS:%=$(B)/%)
	$(call say,MAN,$@)
	$(Q)mkdir -p $(@D) && scripts/man $(B) $< >$@
install: all doc
	install -d $(DESTDIR)$(PREFIX)/bin $(DESTDIR)$(PREFIX)/sbin $(DESTDIR)$(PREFIX)/share/gonio/configs
	install -m755 $(B)/gonio $(B)/goniosim $(DESTDIR)$(PREFIX)/bin
	install -m755 $(B)/goniod $(B)/gonio-guard $(DESTDIR)$(PREFIX)/sbin
	install -d $(DESTDIR)$(PREFIX)/share/gonio/profiles
	install -m644 $(wildcard configs/*.cfg) $(DESTDIR)$(PREFIX)/share/gonio/configs
	install -m644 $(wildcard configs/profiles/*.cfg) $(DESTDIR)$(PREFIX)/share/gonio/profiles
	install -d $(DESTDIR)$(PREFIX)/lib/systemd/system $(DESTDIR)$(PREFIX)/lib/sysusers.d
	sed 's,@PREFIX@,$(PREFIX),' configs/systemd/goniod.service >$(DESTDIR)$(PREFIX)/lib/systemd/system/goniod.service
	install -m644 configs/systemd/gonio.sysusers $(DESTDIR)$(PREFIX)/lib/sysusers.d/gonio.conf
	for page in $(notdir $(MAN)); do \
	    install -D -m644 $(B)/man/$$page $(DESTDIR)$(PREFIX)/share/man/man$${page##*.}/$$page || exit 1; done
uninstall:
	rm -f $(PROGRAMS:%=$(DESTDIR)$(PREFIX)/bin/%) $(DESTDIR)$(PREFIX)/sbin/goniod $(DESTDIR)$(PREFIX)/sbin/gonio-guard
	rm -rf $(DESTDIR)$(PREFIX)/share/gonio
	rm -f $(DESTDIR)$(PREFIX)/lib/systemd/system/goniod.service $(DESTDIR)$(PREFIX)/lib/sysusers.d/gonio.conf
	for page in $(notdir $(MAN)); do rm -f $(DESTDIR)$(PREFIX)/share/man/man$${page##*.}/$$page; done
clean:
	rm -rf build

-include $(OBJECTS:.o=.d)
